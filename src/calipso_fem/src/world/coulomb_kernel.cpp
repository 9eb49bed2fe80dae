#include "coulomb_kernel.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calipso_scene/processor_clones.hpp"

namespace calipso::fem {
namespace {

[[gnu::always_inline]] inline double slipOf(const RigidRow& row, const RowBody& a,
                                            const RowBody& b) {
  const Four s =
      row.normal * (a.linear - b.linear) + row.turn_a * a.angular + row.turn_b * b.angular;
  return s[0] + s[1] + s[2] - row.target;
}

[[gnu::always_inline]] inline void apply(RigidRow& row, double impulse, RowBody& a, RowBody& b) {
  const double change = impulse - row.impulse;
  row.impulse = impulse;
  a.linear += (a.inverse_mass * change) * row.normal;
  a.angular += change * row.angular_a;
  b.linear -= (b.inverse_mass * change) * row.normal;
  b.angular += change * row.angular_b;
}

// @return the change of velocity that the row was off by, squared
[[gnu::always_inline]] inline double solveWithin(double low, double high, RigidRow& row, RowBody& a,
                                                 RowBody& b) {
  const double before = row.impulse, off = slipOf(row, a, b) + row.softness * before;
  apply(row, std::min(high, std::max(low, before - row.inverse * off)), a, b);
  const double change = (row.impulse - before) / row.inverse;
  return change * change;
}

// p <- projection of p - r u onto the disk: r not above the smaller of the two inverse masses makes
// it a contraction, and r alike for both makes the friction of what slides opposite to the slip.
[[gnu::always_inline]] inline double solveFriction(RigidRow& u, RigidRow& v, double limit,
                                                   RowBody& a, RowBody& b) {
  if (limit <= 0.0 && u.impulse == 0.0 && v.impulse == 0.0) return 0.0;
  const double r = std::min(u.inverse, v.inverse);
  double p = u.impulse - r * slipOf(u, a, b), q = v.impulse - r * slipOf(v, a, b);
  const double length = std::sqrt(p * p + q * q);
  if (length > limit) p *= limit / length, q *= limit / length;
  const double dp = p - u.impulse, dq = q - v.impulse;
  apply(u, p, a, b);
  apply(v, q, a, b);
  return (dp * dp + dq * dq) / (r * r);
}

}  // namespace

CALIPSO_CLONES
double sweepRows(RigidRows& rows) {
  constexpr double kUnbounded = std::numeric_limits<double>::infinity();
  RowBody* bodies = rows.bodies.data();
  double off = 0.0;
  for (RigidContact& c : rows.contacts)
    off = std::max(off,
                   solveWithin(0.0, kUnbounded, c.normal, bodies[c.normal.a], bodies[c.normal.b]));
  for (RigidContact& c : rows.contacts)
    off = std::max(
        off, solveFriction(c.u, c.v, c.friction * c.normal.impulse, bodies[c.u.a], bodies[c.u.b]));
  for (RollingRow& r : rows.rolling) {
    const double limit = r.friction * std::min(1.0, rows.contacts[r.contact].normal.impulse);
    off = std::max(off, solveWithin(-limit, limit, r.row, bodies[r.row.a], bodies[r.row.b]));
  }
  return off;
}

}  // namespace calipso::fem

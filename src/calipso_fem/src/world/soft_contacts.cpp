#include "calipso_fem/world/soft_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "contact_compliance.hpp"
#include "step_motion.hpp"

namespace calipso::fem {
namespace {

// A longer step that does not converge is given up: the report then has no bodies, nothing has
// changed, and the caller takes two of half the length.
constexpr double kShortestStep = 1.0 / 500.0;  // s
constexpr int kPasses = 3;         // corrections of one direction
constexpr double kSlow = 0.5;      // share of a violation that a good correction does not leave
// Added to the diagonal: kept columns do not quite make a positive matrix where contacts repeat each
// other. The corrections are exact, so that this costs iterations, not accuracy.
constexpr double kDamping = 0.03;
constexpr double kRenewal = 1.5;   // caution from which new columns pay
constexpr double kMostCaution = 2.0;

ContactRow rowOf(const Contact& c, const StepMotion& motion) {
  const double h = motion.h();
  const Eigen::Matrix3d frame = contactFrame(c.normal);
  ContactRow row;
  row.free_velocity = frame * motion.slip(c) / h;
  row.free_velocity[0] = motion.clearance(c) / h;
  row.start_impulse = row.impulse = h * (frame * c.force);
  row.friction = c.friction;
  row.held_normal = h * c.held_normal;
  row.held_tangential = h * c.held_tangential;
  return row;
}

// How far a contact is from its law, m.
double violation(const ContactRow& row, double h) {
  const double normal = row.impulse[0] > -row.held_normal
                            ? std::abs(row.free_velocity[0])
                            : std::max(0.0, -row.free_velocity[0]);
  const double limit = row.friction * (row.impulse[0] + row.held_normal) + row.held_tangential;
  const bool sticks = row.impulse.tail<2>().norm() < (1.0 - 1e-6) * limit;
  return h * std::max(normal, sticks ? row.free_velocity.tail<2>().norm() : 0.0);
}

// Whether a step may be kept, be it not solved to the last digit.
bool acceptable(const std::map<Contact::Key, Contact>& contacts, const StepMotion& motion) {
  constexpr double kResidual = 100.0;  // tolerances of Newton's iteration
  constexpr double kOff = 0.04;        // minimal distances
  for (const StepMotion::Body& b : motion.bodies())
    if (b.touched && !(b.residual <= kResidual * b.soft->body().options().newton_tolerance)) return false;
  for (const auto& [key, c] : contacts)
    if (c.soft_a >= 0 && !(violation(rowOf(c, motion), motion.h()) <= kOff * c.reach)) return false;
  return true;
}

// A point that came from afar is near from now on.
Contact::Key atRest(Contact::Key key) {
  std::get<3>(key) &= 1;
  return key;
}

}  // namespace

SoftContacts::SoftContacts(const ContactParams& params)
    : params_(params), compliance_(std::make_unique<ContactCompliance>()) {}
SoftContacts::~SoftContacts() = default;

// Drives all contacts to their laws at the bodies' targets. @return whether they are there
bool SoftContacts::correct(const std::vector<Candidate>& watched,
                           const std::vector<Obstacle>& obstacles,
                           const std::vector<SoftEntry>& softs, const RigidWorld& rigid,
                           StepMotion& motion, Contacts& contacts, Correction& correction,
                           ContactReport& report) {
  const double h = motion.h();
  double last_worst = 0.0;  // before the last solve, of the same contacts
  for (int pass = 0;; ++pass) {
    const int added = grow(watched, obstacles, softs, motion, contacts);
    std::vector<ContactRow> rows;
    double worst = 0.0;
    for (const auto& [key, c] : contacts) {
      rows.push_back(rowOf(c, motion));
      worst = std::max(worst, violation(rows.back(), h));
    }
    // What does not converge has another compliance by now.
    const bool slow = added == 0 && last_worst > 0.0 && worst > kSlow * last_worst &&
                      worst > params_.allowed_depth;
    if (slow && correction.caution >= kRenewal && !std::exchange(correction.renewed, true)) {
      for (const StepMotion::Body& b : motion.bodies())
        if (b.touched) b.soft->forgetCompliance();
      compliance_->forget();
    } else if (slow) {
      correction.caution = std::min(kMostCaution, 1.25 * correction.caution);
    }
    last_worst = worst;
    const bool done = added == 0 && worst <= params_.allowed_depth;
    if (done || rows.empty() || pass == kPasses) return done || rows.empty();
    Eigen::MatrixXd W = correction.caution * compliance_->of(contacts, softs, rigid, h);
    W.diagonal() *= 1.0 + kDamping;
    report.iterations += solveContacts(W, rows, params_.iterations, params_.tolerance).iterations;
    size_t i = 0;
    for (auto& [key, c] : contacts)
      c.force = contactFrame(c.normal).transpose() * rows[i++].impulse / h;
    motion.setForces(contacts, true);
  }
}

ContactReport SoftContacts::step(const std::vector<SoftEntry>& softs,
                                 const std::vector<Obstacle>& obstacles, RigidWorld& rigid,
                                 double h) {
  ContactReport report;
  const std::vector<Candidate> watched = candidates(softs, obstacles, rigid, h);
  StepMotion motion(softs, obstacles, rigid, h);
  // What pushed in the last step pushes from the start, and is a contact as long as it is near.
  Contacts contacts;
  for (const Candidate& c : watched) {
    const auto known = memory_.find(c.contact.key);
    if (c.near && known != memory_.end() && !known->second.force.isZero(0.0))
      contacts.emplace(c.contact.key, completed(c.contact));
  }
  addRigidTouches(watched, rigid, contacts);
  motion.setForces(contacts, false);
  Correction correction;
  bool open = true;  // some contact is off its law
  while (true) {
    bool moving = false;
    for (StepMotion::Body& b : motion.bodies()) {
      const FemOptions& options = b.soft->body().options();
      const int most = options.linearised ? 1 : options.newton_iterations;
      const bool first = report.newton_iterations == 0;
      const bool unbalanced = report.newton_iterations < most && !b.stuck &&
                              b.residual > options.newton_tolerance;
      const bool unsettled =
          report.newton_iterations < params_.newton_iterations && open && b.touched;
      if (!first && !unbalanced && !unsettled) continue;
      moving = true;
      motion.aim(b);
    }
    if (!moving) break;
    ++report.newton_iterations;
    open = !correct(watched, obstacles, softs, rigid, motion, contacts, correction, report);
    motion.advance();
  }
  for (const auto& [key, c] : contacts) {
    report.deepest = std::max(report.deepest, c.offset - motion.gap(c));
    report.contacts += c.soft_a >= 0 && !c.force.isZero(0.0);
  }
  report.converged = !open;
  if (h > kShortestStep && !acceptable(contacts, motion)) return report;
  remember(contacts, motion);
  publish(contacts, motion, softs, obstacles);
  report.bodies = motion.finish(contacts);
  return report;
}

// What rigid bodies near a deformable one rest on holds against its push. Bullet solves these contacts
// itself afterwards; here they only keep the deformable side from pushing the rigid one through.
void SoftContacts::addRigidTouches(const std::vector<Candidate>& watched, const RigidWorld& rigid,
                                   Contacts& contacts) const {
  constexpr int kNoSoft = std::numeric_limits<int>::max();
  std::set<RigidWorld::Id> ids;
  for (const Candidate& c : watched)
    if (c.near && c.contact.rigid_b) ids.insert(*c.contact.rigid_b);
  if (ids.empty()) return;
  int index = 0;
  for (const RigidTouch& t : rigid.touchesAround(ids)) {
    Contact c;
    c.key = {kNoSoft, 0, index++, 0};
    c.rigid_a = t.a;
    c.rigid_b = t.b;
    c.place = t.place;
    c.normal = t.normal;
    c.start_gap = t.gap;
    c.friction = t.friction;
    contacts.emplace(c.key, c);
  }
}

void SoftContacts::remember(const Contacts& contacts, const StepMotion& motion) {
  for (auto it = memory_.begin(); it != memory_.end();) {
    it->second.force.setZero();
    const bool empty = !it->second.holds && it->second.offset >= 0.0;
    it = empty ? memory_.erase(it) : std::next(it);
  }
  for (const auto& [key, c] : contacts) {
    if (c.soft_a < 0) continue;
    Memory& m = memory_[atRest(key)];
    if (m.force.squaredNorm() > c.force.squaredNorm()) continue;  // found twice: once is enough
    m.force = c.force;
    const double gap = motion.gap(c);
    if (m.holds && gap - m.offset > 0.2 * c.reach) {  // apart: what held it holds no more
      m.holds = false;
      m.held_normal = m.held_tangential = 0.0;
    }
    if (!m.holds) m.offset = std::min(0.0, std::max(m.offset, gap));
    if (m.force.isZero(0.0) && !m.holds && m.offset >= 0.0) memory_.erase(atRest(key));
  }
}

void SoftContacts::publish(const Contacts& contacts, const StepMotion& motion,
                           const std::vector<SoftEntry>& softs,
                           const std::vector<Obstacle>& obstacles) {
  contacts_.clear();
  for (const auto& [key, c] : contacts) {
    if (c.soft_a < 0 || c.force.isZero(0.0)) continue;
    ContactPoint p;
    p.a = softs[c.soft_a].name;
    p.b = obstacles[c.obstacle].name;
    p.position = c.place;
    p.normal = c.normal;
    p.force = c.force;
    p.depth = c.offset - motion.gap(c);
    contacts_.push_back(p);
  }
}

}  // namespace calipso::fem

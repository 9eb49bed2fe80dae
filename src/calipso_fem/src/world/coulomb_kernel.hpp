#pragma once

#include <vector>

// Sweeps of the rigid bodies' contact solver. Private to the rigid world.
namespace calipso::fem {

using Four = double __attribute__((vector_size(32), aligned(8)));  // x, y, z, 0

struct RowBody {
  Four linear, angular;  // change of velocity by the impulses
  double inverse_mass = 0.0;
};

// velocity along the row = n . (v_a - v_b) + t_a . w_a + t_b . w_b
struct RigidRow {
  Four normal, turn_a, turn_b;
  Four angular_a, angular_b;           // I^-1 t
  double target = 0.0, inverse = 0.0;  // velocity; impulse per velocity
  double softness = 0.0;               // velocity per impulse
  double impulse = 0.0;
  int a = 0, b = 0;
};

struct RigidContact {
  RigidRow normal, u, v;
  double friction = 0.0;
};

struct RollingRow {
  RigidRow row;
  double friction = 0.0;
  int contact = 0;
};

struct RigidRows {
  std::vector<RowBody> bodies;
  std::vector<RigidContact> contacts;
  std::vector<RollingRow> rolling;
};

// One pass over all rows. @return the square of the largest change of velocity that one was off by
double sweepRows(RigidRows& rows);

}  // namespace calipso::fem

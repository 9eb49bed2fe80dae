#pragma once

namespace calipso::fem {

struct BulletResult {
  int nodes = 0;
  double tip = 0.0;  // mean y displacement of the end face after the last step, m
  double cpu_ms_per_step = 0.0;
};

// Bullet's deformable body (btDeformableMultiBodyDynamicsWorld, implicit, linear elasticity) on the
// reference beam of 4n x n x n cubes, each split into six tetrahedra: gravity, x = 0 held, `steps`
// steps of h.
BulletResult runBulletBeam(int n, double h, int steps);

}  // namespace calipso::fem

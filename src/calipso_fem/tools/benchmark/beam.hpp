#pragma once

#include <ctime>
#include <string>

#include "calipso_fem/deformable_body.hpp"

namespace calipso::fem {

// The reference beam: [0, 1] x [0, 0.25]^2 m of 4n x n x n cells, clamped at x = 0, E = 1e6 Pa, nu
// = 0.3, 1000 kg/m^3, under gravity.
DeformableBody makeBeam(int n, const FemOptions& options);

// Mean y displacement of the end face, m.
double tipHeight(const DeformableBody& body);

// CPU time of the process, all threads.
inline double cpuMilliseconds() { return 1000.0 * std::clock() / CLOCKS_PER_SEC; }

// Where the beam ends and what it costs, for every kind of setting, and Bullet's deformable body on
// the same beam; JSON lines.
void measureRest();  // after 16 s of steps of 1/30 s, against its equilibrium on a fine grid
void measureTrajectories();  // at 0.5 s, against a run with small steps on a finer grid

}  // namespace calipso::fem

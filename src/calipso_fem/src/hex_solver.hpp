#pragma once

#include <memory>
#include <vector>

#include "hex_coarsening.hpp"
#include "hex_level.hpp"
#include "linear_solver.hpp"
#include "multigrid.hpp"

namespace calipso::fem {

// Solves A x = b without assembling A: CG in double precision, multigrid in single. The multigrid's
// fine level follows x at every setSystem(); its diagonal and coarse levels are renewed when that
// has become worth it.
class HexSolver {
 public:
  // mesh and hexes must outlive this. @throw std::invalid_argument for a mesh without lattice
  HexSolver(const VolumeMesh& mesh, const StvkHexes& hexes);
  ~HexSolver();

  // True where the lattice fits the cells, as it does for voxel grids and boxes.
  static bool fits(const VolumeMesh& mesh);

  // The cells have been packed anew.
  void setHexes(const StvkHexes& hexes);
  // fixed: dofs taken out. Takes positions and stresses out of `at`. False: the matrix has shown
  // not to be positive definite.
  bool setSystem(HexEvaluation* at, HexSystem system, const Eigen::VectorXd& lumped_mass,
                 const std::vector<int>& fixed);
  // y = A x, the fixed components included.
  void multiply(const Vec& x, Vec* y);
  // b and x: zero at fixed components. x is the start value on entry.
  SolveReport solve(const Vec& b, double tolerance, int most_iterations, Vec* x);
  void invalidate() { stale_ = true; }
  // Residual that rounding of positions y and inner forces alone leaves, N.
  double roundOff(const Vec& y) const;

 private:
  struct Vectors;
  class Iteration;

  bool refresh();
  void sumCoarse();
  void addMassAndSprings();
  void product(const Crew& crew, int begin, int end, const double* x, double* y) const;
  SolveReport iterate(const Vec& b, double tolerance, int most_iterations, Vec* x);

  const StvkHexes* hexes_;
  AlignedBuffer<double> x_, stress_;  // as in HexEvaluation
  AlignedBuffer<double> viscous_x_;   // as x_, where the viscosity acts; empty: at x_
  AlignedBuffer<double> diagonal_;    // blocks, 9 per node
  AlignedBuffer<double> mass_;        // inertia times mass, kg/s^2
  HexSystem system_;                  // springs in the numbering of hexes_
  HexCoarsening coarsening_;
  std::unique_ptr<HexLevel> fine_;
  std::unique_ptr<Vectors> vectors_;
  Multigrid multigrid_;
  bool stale_ = true;
  bool current_ = false;     // the multigrid was renewed for this system
  double decades_ = 0.0;     // of residual in the last solve
  double fresh_rate_ = 0.0;  // CG iterations per decade in the first solve after the last renewal
  double wasted_iterations_ = 0.0;  // those above that rate since then
};

}  // namespace calipso::fem

#pragma once

#include <functional>
#include <memory>

#include "calipso_align/observation.hpp"
#include "calipso_align/silhouette.hpp"
#include "calipso_fem/elastic_model.hpp"
#include "calipso_fem/embedding.hpp"

// The model as an elastic body that measurements pull on (eq. 9):
//   min over x   lambda Psi(x) / (E V) + 1/2 sum of w r(J x)^2 + eps/2 |x - x0|^2
//  code    meaning                                                           unit
//  x       nodal positions, 3n, camera frame                                 m
//  Psi     the simulator's elastic energy; its rest shape is where the       J
//          low-order stage ended
//  E V     Young's modulus times volume, so that Psi / (E V) is a mean squared strain
//  lambda  what a mean squared strain of one costs, in units of r^2 w
//  eps     keeps nodes that nothing holds where they are, above all along the sight line; where
//          nothing shows the depth, they are held there
namespace calipso::align {

struct FemStageOptions {
  int nodes = 600;  // about
  double poissons_ratio = 0.0;
  bool linear = false;  // constant K, as eq. 9 has it, instead of corotated elements
  std::vector<double> elastic_weights = {1e4};  // lambda, one per iteration: soft contour to stiff
  bool hold_depth = false;                      // nodes only move across the optical axis
  double drift_sigma = 1.0;     // of nodes that nothing holds, in model sizes, all together
  double smallest_step = 1e-4;  // of the model's size
};

struct FemStageReport {
  int nodes = 0;
  int iterations = 0;
  bool converged = false;
  int damped = 0;        // iterations whose system was not positive definite until it was stiffened
  bool solvable = true;  // false: even then it was not, and the fit stands where it was
};

// Cubes that cover the model, object frame.
// @throw std::invalid_argument for a mesh that cannot be covered by a grid
fem::VoxelGrid gridOf(const TriangleMesh& cad, int nodes);

// The body on one grid.
class ElasticFit {
 public:
  // @param cad        stock model, object frame
  // @param grid       covers it
  // @param placed     maps points of the object frame to where the fit stands (camera frame)
  ElasticFit(const TriangleMesh& cad, const fem::VoxelGrid& grid,
             const std::function<Points(const Points&)>& placed, const FemStageOptions& options);

  // Newton steps with re-linearised measurements; `observe` as in fitLowOrder().
  FemStageReport fit(const std::function<Rows(const Points&, int)>& observe);

  Points vertices() const;  // where the model's vertices stand, camera frame
  // Where points of the object frame stand, carried by the grid.
  Points carry(const Points& object_points) const;

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace calipso::align

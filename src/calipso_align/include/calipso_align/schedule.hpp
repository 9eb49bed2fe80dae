#pragma once

#include <string>
#include <vector>

#include "calipso_align/fem_stage.hpp"
#include "calipso_align/fit_problem.hpp"
#include "calipso_align/low_order_stage.hpp"

// The order of a fit: which freedom the model has in which stage, and how strictly it is held to
// the picture meanwhile. Lengths are parts of the contour's extent (px) or of the model's size (m).
namespace calipso::align {

// A quantity that goes geometrically from one value to another during a stage.
struct Ramp {
  double from, to;
  double at(int k, int count) const;
};

// How far a rough placement may be off: part of the distance, in any direction.
constexpr double kPlacementError = 0.05;

// Where a roughly placed object may be (centroids, camera frame). An offset of any length up to the
// bound and any direction has a density of 1 / r^2: the picture shows how far the placement is off
// across the sight line, and that says something of the distance. Not that it is right where the
// rest is, though: the picture guides a hand across the sight line, not along it.
class PlacementPrior {
 public:
  // @param found  where the fit has the object: a placement that was further off across the sight
  //               line than it may be, may be as far off along it
  PlacementPrior(const Eigen::Vector3d& placed, const Eigen::Vector3d& found);
  double density(const Eigen::Vector3d& centroid) const;  // not normalised; 0 beyond the bound

 private:
  Eigen::Vector3d placed_;
  double bound_;  // part of the distance
};

struct LowOrderStep {
  std::string name;
  LowOrderStageOptions fit;
  Ramp robust{0.10, 0.06};        // of the contour, parts of its extent
  Ramp depth_robust{0.15, 0.10};  // model sizes
  int order = 0;                  // of the deformation: none, affine, quadratic
  bool literal = false;           // eq. 9 as it stands
};

// What a deformation of this size has beyond this order, about a third of the size away from the
// centroid; model sizes.
double unresolved(int order, double deformation);

// Similarity, affine, quadratic.
std::vector<LowOrderStep> lowOrderSteps(const FitProblem& problem, const AlignOptions& options);
MeasureSettings settingsAt(const LowOrderStep& step, const FitProblem& problem, int iteration,
                           double deformation);

struct ElasticStep {
  FemStageOptions fit;
  Ramp robust_px{4.0, 4.0}, dead_band_px{4.0, 4.0};
  bool literal = false;
};

// One per grid, coarse to fine.
std::vector<ElasticStep> elasticSteps(const FitProblem& problem, const AlignOptions& options);
MeasureSettings settingsAt(const ElasticStep& step, const FitProblem& problem, int iteration);

// The same once more, for what the step left far off: softer, and with pairs from further away.
ElasticStep farReaching(const ElasticStep& step, const FitProblem& problem);

}  // namespace calipso::align

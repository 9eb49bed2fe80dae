#pragma once

#include "calipso_align/contour_target.hpp"
#include "calipso_align/observation.hpp"
#include "calipso_align/silhouette.hpp"

namespace calipso::align {

// How strictly the model is held to the contour at one stage of the fit.
struct ContourTermOptions {
  double robust_px = 8.0;         // residuals beyond are outliers (Geman-McClure)
  double dead_band_px = 0.0;      // residuals below pull nothing: eq. 9's relaxed constraint
  double reject_px = 60.0;        // pairs farther apart are none
  double reject_cosine = 0.3;     // pairs whose normals differ more are none
  double normal_scale_px = 25.0;  // how many pixels a normal that is off by 1 counts for
  double tangential = 0.02;       // weight along the contour, where points can slide
  bool two_way = true;            // model to picture as well as picture to model
};

// Index of the outline point that each target point meets, -1 for none.
std::vector<int> matchTargetToOutline(const ContourTarget& target,
                                      const std::vector<OutlinePoint>& outline,
                                      const ContourTermOptions& options);

// The contour's pull on the model, in px: for every pair, the distance along the target's normal.
// Weights sum up to the contour's known length, so that sampling does not change the balance.
Rows contourRows(const ContourTarget& target, const std::vector<OutlinePoint>& outline,
                 const Camera& camera, const ContourTermOptions& options);

// Signed distances (px, positive: the model reaches too far out) of all known target points to the
// model's outline; NaN where there is no counterpart.
std::vector<double> contourResiduals(const ContourTarget& target,
                                     const std::vector<OutlinePoint>& outline);

}  // namespace calipso::align

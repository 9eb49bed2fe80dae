#pragma once

#include "calipso_align/fit_problem.hpp"
#include "calipso_align/shape_uncertainty.hpp"

namespace calipso::align {

// What the contour says about a finished fit.
struct FitQuality {
  std::vector<double> residuals;  // signed, per target point, px; NaN without counterpart
  double mean_px = 0.0, p95_px = 0.0;
  double tolerance_px = 0.0;      // what counts as met: the contour's noise and a little more
  double met = 0.0;               // part of the known contour that the model meets
  double met_mean_px = 0.0;       // of that part
  double open = 0.0;              // part of the contour's area that the model leaves open
  double protruding = 0.0;        // area of the model outside of the contour, part of the contour's
  double model_holes_px = 0.0;    // area of the model's holes that the contour has not, px^2
  double picture_holes_px = 0.0;  // area of the contour's holes that the model has not, px^2
};

FitQuality assess(const FitProblem& problem, const Points& x);

// How far the model is from the contour as a whole: area that is open or protrudes, as part of the
// contour's, and what is not met of its length, which counts less, for a lattice's holes may not be
// those of the picture.
double misfit(const FitQuality& quality);

// Parts of the model's size that the surface of a trusted fit may be off in 3D.
constexpr SurfaceDistance kTrustedWithin{0.04, 0.06};

struct Verdict {
  bool trusted = false;
  std::string reason;  // why not; or what the user should know all the same
};

// @param scale           size of the fitted model relative to the stock model
// @param distance_sigma  deviation of its distance, as part of it
// @param error           what the fitted surface may be off
Verdict judge(const FitProblem& problem, const std::vector<ContourLoop>& contour,
              const FitQuality& quality, double scale, double distance_sigma,
              const ShapeUncertainty& error);

// Whether turning the model about one of its principal axes leaves it where it was: then no contour
// shows that turn. Returns the axis in the frame of X.
std::optional<Eigen::Vector3d> spinAxis(const Points& X, const Triangles& triangles);

}  // namespace calipso::align

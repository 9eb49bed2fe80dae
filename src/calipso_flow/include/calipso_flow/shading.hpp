#pragma once

#include <Eigen/Core>
#include <vector>

#include "calipso_flow/deformable_tracker.hpp"

namespace calipso::flow {

// How the light on a deforming surface changes: its slopes show in it, also where the surface
// moves along the line of sight. Principal components of the logarithm of the brightness.
struct Shading {
  Eigen::MatrixXd shapes;      // P x K, orthonormal, over DeformableTracker::points
  Eigen::MatrixXd amplitudes;  // T x K
  double noise = 0.0;          // standard deviation of an amplitude

  int count() const { return static_cast<int>(shapes.cols()); }
};

// Points that are not seen in most frames are left out (zero in the shapes); there may be no
// component.
Shading shadingOf(const std::vector<DeformationObservation>& observations);

// The wave vector k, rad per unit of length, of a field that goes as exp(-i k.x) times a positive
// envelope: where its spatial spectrum is largest.
// @param points    #P x 2
// @param farthest  of |k| that is looked for
struct PlaneWave {
  Eigen::Vector2d wave_vector = Eigen::Vector2d::Zero();
  double power = 0.0;     // share of the field's that the wave shows, were its envelope even
  double opposite = 0.0;  // the same of the best wave that travels against it
};
PlaneWave planeWaveIn(const Eigen::Matrix<double, Eigen::Dynamic, 2>& points,
                      const Eigen::VectorXcd& field, double farthest);

// Standard deviation of what changes from frame to frame without connection.
double noiseOf(const Eigen::VectorXd& series);

}  // namespace calipso::flow

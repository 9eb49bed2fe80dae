#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calipso_flow/deformation_modes.hpp"
#include "calipso_flow/wind_course.hpp"

namespace calipso::flow {

// The wind under which the simulated sheet moves as the tracked one does:
//   min over w, s   sum_k |S^-1 (Phi^+ (x_k(w, s) - x_0) - q_k)|^2
//                   + |w' / sigma'|^2 + |w / sigma|^2 + |log s / tau|^2
//  x_k     shape at frame k, by the simulator, from the key frame's shape in equilibrium under
//          gravity
//  q_k     observed amplitudes of the modes Phi, S their deviations
//  w       velocity of the air, linear between knots; m/s, world axes
//  s       the sheet's modulus over that which the simulator starts with. It is no less unknown
//          than the wind, and on cubes of edge h that are thicker than the sheet its stiffness in
//          bending goes with h^2: s takes up both.
struct WindEstimate : WindCourse {
  std::vector<Eigen::Matrix3d> covariance;         // m^2/s^2, at the knots
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();  // m/s, over the clip
  Eigen::Matrix3d mean_covariance = Eigen::Matrix3d::Zero();
  Eigen::MatrixXd amplitudes;  // T x K, m: of the modes, as the sheet simulated in this wind moves
  double stiffness_over_density = 0.0;  // E/rho on the simulator's own grid, m^2/s^2
  double stiffness_over_density_deviation = 0.0;
  double explained = 0.0;  // share of the observed motion's mean square that the simulation shows

  Eigen::Matrix3d covarianceAt(
      double time) const;  // linear between the knots, as if their errors were one
};

struct WindParams {
  int nodes = 90;              // of the simulated sheet's grid; more where it finds no equilibrium
  int simulator_nodes = 1200;  // of the grid for which the stiffness is told
  double longest_step = 1.0 / 30.0;  // s, of the simulation
  double knot_spacing = 0.5;         // s
  // m/s, deviation of the wind before anything is seen, level with the ground
  double strongest = 6.0;
  double rising = 0.5;       // m/s, the same up and down
  double change = 3.0;       // m/s per square root of a second, deviation of its changes
  double stiffness = 1.5;    // deviation of the logarithm of s
  double model_error = 0.1;  // of the motion: what the simulation cannot show
  double least_explained = 0.35;
};

// @param times  s, one per row of the modes' amplitudes; the first is the key frame
// @param note   says why nothing is returned
std::optional<WindEstimate> estimateWind(const ObjectModel& model, const std::vector<double>& times,
                                         const DeformationModes& modes,
                                         const Eigen::Vector3d& gravity, std::string& note,
                                         const WindParams& params = {});

}  // namespace calipso::flow

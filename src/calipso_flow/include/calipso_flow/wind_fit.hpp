#pragma once

#include <vector>

#include "calipso_flow/cloth_simulation.hpp"

namespace calipso::flow {

// The wind that moves a cloth, one vector at each frame. What does not press on the cloth, such as
// wind along a flat one, is not seen: it is taken as zero, with the deviation of ignorance.
struct WindEstimate {
  std::vector<Eigen::Vector3d> velocity;    // m/s, world, per frame
  std::vector<Eigen::Matrix3d> covariance;  // (m/s)^2
  std::vector<Eigen::Vector3d> pressure;    // Pa, world, per frame: force over the sheet's area
  double drag = 0.0;       // kg/m^3, see dragOf
  double density = 0.0;    // kg/m^3, of the cloth: velocity^2 goes with it
  double explained = 0.0;  // share of the observed motion that the simulated cloth shows
};

// Fits a slowly varying wind through the simulation: knots every quarter of a second, so that the
// simulated surface follows the observed one.
// @param surfaces  observed, world, one per time, the first as the model stands
// @param velocity  of the vertices at the first time, world
// @throw as ClothSimulation
WindEstimate fitWind(const ObjectModel& model, const Eigen::Vector3d& gravity,
                     const std::vector<double>& times,
                     const std::vector<ClothSimulation::Vertices>& surfaces,
                     const ClothSimulation::Vertices& velocity);

}  // namespace calipso::flow

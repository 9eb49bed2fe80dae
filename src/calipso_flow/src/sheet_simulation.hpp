#pragma once

#include <calipso_fem/world/soft_object.hpp>
#include <functional>
#include <vector>

#include "calipso_flow/object_model.hpp"

namespace calipso::flow {

using SurfaceVector = Eigen::VectorXd;  // 3 #V

// A thin object of the video as the simulator moves it in the wind: with the material an object of
// its size starts with, held where it is attached, in equilibrium in its key-frame shape.
class SheetSimulation {
 public:
  // @param longest_step  s
  // @param stiffness     times the modulus an object of its size starts with
  // @throw std::invalid_argument as the simulator does; std::runtime_error without an equilibrium
  SheetSimulation(const ObjectModel& model, const Eigen::Vector3d& gravity, int nodes,
                  double longest_step, double stiffness = 1.0);

  using Wind = std::function<Eigen::Vector3d(double time)>;  // m/s, world
  // Displacements of the surface from the key frame's shape at every time, world axes, m.
  // @param velocities  of the surface at the first time, world axes, m/s
  std::vector<SurfaceVector> run(const std::vector<double>& times, const SurfaceVector& velocities,
                                 const Wind& wind);
  double stiffnessRatio() const { return stiffness_over_density_; }  // E/rho, m^2/s^2

 private:
  void blow(const Eigen::Vector3d& wind, double h);

  double longest_step_;   // s
  TriangleMesh surface_;  // world
  bool closed_;
  double areal_density_;  // kg/m^2
  double stiffness_over_density_;
  fem::SoftObject sheet_;
  Eigen::VectorXd start_;  // 3 #N, nodes in the key frame
};

}  // namespace calipso::flow

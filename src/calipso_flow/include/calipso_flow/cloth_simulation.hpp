#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <vector>

#include "calipso_flow/object_model.hpp"

// The object itself, simulated by finite elements as the simulator does, in a wind w:
//   f = rho C A ((w - u).n) |(w - u).n| / 2  n   on each triangle (area A, normal n, velocity u).
namespace calipso::flow {

using WindOverTime = std::function<Eigen::Vector3d(double time)>;  // s -> m/s, world

// rho C for each triangle of a mesh: a closed sheet has two faces, each of which takes half, kg/m^3.
double dragOf(const TriangleMesh& mesh);

// Area of a sheet: of one of its faces where it is closed, m^2.
double sheetArea(const TriangleMesh& mesh);

// Force of the wind on each vertex, N. All #V x 3, world axes.
decltype(TriangleMesh::vertices) windForces(const TriangleMesh& mesh,
                                            const decltype(TriangleMesh::vertices)& positions,
                                            const decltype(TriangleMesh::vertices)& velocities,
                                            const Eigen::Vector3d& wind, double drag);

class ClothSimulation {
 public:
  using Vertices = decltype(TriangleMesh::vertices);

  // The model as it stands hangs in still air from its attached vertices.
  // @throw std::invalid_argument when nothing holds it, or the mesh cannot be simulated
  ClothSimulation(const ObjectModel& model, const Eigen::Vector3d& gravity);
  ~ClothSimulation();

  // Surfaces at the given times, world, the first as the model stands.
  // @param velocity  of the vertices at the first time, #V x 3, world
  std::vector<Vertices> run(const std::vector<double>& times, const WindOverTime& wind,
                            const Vertices& velocity);

  double density() const { return density_; }  // kg/m^3

 private:
  struct Body;
  std::unique_ptr<Body> body_;
  TriangleMesh surface_;  // world
  double drag_, density_;
};

}  // namespace calipso::flow

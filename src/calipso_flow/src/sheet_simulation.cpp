#include "sheet_simulation.hpp"

#include <calipso_fem/world/mass_properties.hpp>
#include <calipso_fem/world/wind.hpp>
#include <calipso_fem/world/world_types.hpp>
#include <cmath>
#include <stdexcept>

namespace calipso::flow {
namespace {

constexpr double kSag = 1e-3;    // of the diagonal, that the key frame's shape may give way by

TriangleMesh inWorld(const ObjectModel& model) {
  TriangleMesh mesh = model.mesh;
  mesh.vertices = (mesh.vertices * model.world_from_object.linear().transpose()).rowwise() +
                  model.world_from_object.translation().transpose();
  return mesh;
}

double areaOf(const TriangleMesh& mesh) {
  double doubled = 0.0;
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const Eigen::Vector3d a = mesh.vertex(mesh.triangles(t, 0));
    doubled += (mesh.vertex(mesh.triangles(t, 1)) - a).cross(mesh.vertex(mesh.triangles(t, 2)) - a).norm();
  }
  return 0.5 * doubled;
}

Material softened(const TriangleMesh& surface, const Eigen::Vector3d& gravity, double stiffness) {
  Material material = defaultMaterial(boundingDiagonal(surface), gravity.norm());
  material.youngs_modulus *= stiffness;
  return material;
}

fem::FemOptions optionsFor(int nodes) {
  fem::FemOptions options;
  options.target_nodes = nodes;
  options.threads = 1;
  options.newton_tolerance = 1e-3;
  options.newton_iterations = 8;
  return options;
}

}  // namespace

SheetSimulation::SheetSimulation(const ObjectModel& model, const Eigen::Vector3d& gravity, int nodes,
                                 double longest_step, double stiffness)
    : longest_step_(longest_step),
      surface_(inWorld(model)),
      closed_(fem::isClosed(surface_)),
      sheet_(surface_, softened(surface_, gravity, stiffness), optionsFor(nodes)) {
  const Material material = softened(surface_, gravity, stiffness);
  stiffness_over_density_ = material.youngs_modulus / material.density;
  areal_density_ = sheet_.body().totalMass() / ((closed_ ? 0.5 : 1.0) * areaOf(surface_));
  if (!model.attached.empty()) sheet_.body().fixSurfaceVertices(model.attached);
  sheet_.setGravity(gravity);
  std::vector<fem::HoldPoint> hold;
  const fem::SettleReport report =
      sheet_.settle(gravity, hold, kSag * boundingDiagonal(surface_));
  if (!report.message.empty()) throw std::runtime_error(report.message);
  start_ = sheet_.body().positions();
}

void SheetSimulation::blow(const Eigen::Vector3d& wind, double h) {
  const Eigen::VectorXd positions = sheet_.body().surfaceVertices();
  const Eigen::VectorXd velocities = sheet_.body().surfaceVelocities();
  const Eigen::Index count = positions.size() / 3;
  const fem::Air air{wind, (closed_ ? 0.5 : 1.0) * fem::kAirDrag};
  const fem::Vertices forces = fem::windForces(
      Eigen::Map<const fem::Vertices>(positions.data(), count, 3),
      Eigen::Map<const fem::Vertices>(velocities.data(), count, 3), surface_.triangles, air,
      areal_density_, h);
  sheet_.body().setSurfaceForces(Eigen::Map<const Eigen::VectorXd>(forces.data(), forces.size()));
}

std::vector<SurfaceVector> SheetSimulation::run(const std::vector<double>& times,
                                                const SurfaceVector& velocities, const Wind& wind) {
  fem::DeformableBody& body = sheet_.body();
  body.setState(start_, sheet_.nodalField(velocities));
  const Eigen::VectorXd shape = body.surfaceVertices();
  std::vector<SurfaceVector> displacements{SurfaceVector::Zero(shape.size())};
  for (size_t k = 1; k < times.size(); ++k) {
    const double span = times[k] - times[k - 1];
    const int steps = std::max(1, static_cast<int>(std::ceil(span / longest_step_ - 1e-6)));
    const double h = span / steps;
    for (int s = 0; s < steps; ++s) {
      blow(wind(times[k - 1] + (s + 0.5) * h), h);
      body.step(h);
    }
    displacements.push_back(body.surfaceVertices() - shape);
  }
  return displacements;
}

}  // namespace calipso::flow

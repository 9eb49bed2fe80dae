#include "calipso_flow/cloth_simulation.hpp"

#include <calipso_fem/world/soft_object.hpp>
#include <calipso_scene/material.hpp>
#include <map>
#include <stdexcept>

namespace calipso::flow {
namespace {

constexpr double kAirDrag = 1.2;      // kg/m^3: density of air, coefficient of drag 1
constexpr int kNodes = 200;
constexpr int kSubsteps = 1;          // per frame
constexpr double kSagOfSize = 1e-3;   // tolerance of the equilibrium in the key frame

bool isClosed(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, int> uses;
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    for (int e = 0; e < 3; ++e) {
      ++uses[std::minmax(mesh.triangles(t, e), mesh.triangles(t, (e + 1) % 3))];
    }
  }
  for (const auto& [edge, count] : uses) {
    if (count != 2) return false;
  }
  return true;
}

TriangleMesh placed(const ObjectModel& model) {
  TriangleMesh surface = model.mesh;
  surface.vertices =
      (model.mesh.vertices * model.world_from_object.linear().transpose()).rowwise() +
      model.world_from_object.translation().transpose();
  return surface;
}

}  // namespace

double dragOf(const TriangleMesh& mesh) { return isClosed(mesh) ? 0.5 * kAirDrag : kAirDrag; }

double sheetArea(const TriangleMesh& mesh) {
  double area = 0.0;
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const Eigen::Vector3d a = mesh.vertex(mesh.triangles(t, 0));
    area += 0.5 * (mesh.vertex(mesh.triangles(t, 1)) - a)
                      .cross(mesh.vertex(mesh.triangles(t, 2)) - a)
                      .norm();
  }
  return isClosed(mesh) ? 0.5 * area : area;
}

decltype(TriangleMesh::vertices) windForces(const TriangleMesh& mesh,
                                            const decltype(TriangleMesh::vertices)& positions,
                                            const decltype(TriangleMesh::vertices)& velocities,
                                            const Eigen::Vector3d& wind, double drag) {
  decltype(TriangleMesh::vertices) forces(positions.rows(), 3);
  forces.setZero();
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const Eigen::Vector3i c = mesh.triangles.row(t).transpose();
    const Eigen::RowVector3d a = positions.row(c[0]);
    const Eigen::RowVector3d ab = positions.row(c[1]) - a, ac = positions.row(c[2]) - a;
    const Eigen::RowVector3d doubled = ab.cross(ac);
    const double area = 0.5 * doubled.norm();
    if (area <= 0.0) continue;
    const Eigen::RowVector3d n = doubled / (2.0 * area);
    const Eigen::RowVector3d u =
        (velocities.row(c[0]) + velocities.row(c[1]) + velocities.row(c[2])) / 3.0;
    const double across = (wind.transpose() - u).dot(n);
    const Eigen::RowVector3d share = 0.5 * drag * area * across * std::abs(across) / 3.0 * n;
    for (int k = 0; k < 3; ++k) forces.row(c[k]) += share;
  }
  return forces;
}

struct ClothSimulation::Body {
  fem::SoftObject soft;
  fem::Vec rest_positions;  // of the nodes in the key frame's equilibrium
  std::vector<int> nearest;  // per node the nearest vertex
};

ClothSimulation::ClothSimulation(const ObjectModel& model, const Eigen::Vector3d& gravity)
    : surface_(placed(model)), drag_(dragOf(model.mesh)) {
  if (model.attached.empty()) {
    throw std::invalid_argument("wind on " + model.name +
                                ": nothing says where it is held; give an attachment hint");
  }
  const Material material = defaultMaterial(boundingDiagonal(surface_), gravity.norm());
  density_ = material.density;
  fem::FemOptions options;
  options.target_nodes = kNodes;
  body_ = std::make_unique<Body>(Body{fem::SoftObject(surface_, material, options), {}, {}});
  fem::DeformableBody& body = body_->soft.body();
  body.fixSurfaceVertices(model.attached);
  body_->soft.setGravity(gravity);
  std::vector<fem::HoldPoint> hold;
  body_->soft.settle(gravity, hold, kSagOfSize * boundingDiagonal(surface_));
  body_->rest_positions = body.positions();
  for (int i = 0; i < body.nodeCount(); ++i) {
    const Eigen::RowVector3d node = body_->rest_positions.segment<3>(3 * i).transpose();
    int nearest = 0;
    (surface_.vertices.rowwise() - node).rowwise().squaredNorm().minCoeff(&nearest);
    body_->nearest.push_back(nearest);
  }
}

ClothSimulation::~ClothSimulation() = default;

std::vector<ClothSimulation::Vertices> ClothSimulation::run(const std::vector<double>& times,
                                                            const WindOverTime& wind,
                                                            const Vertices& velocity) {
  fem::SoftObject& soft = body_->soft;
  fem::DeformableBody& body = soft.body();
  fem::Vec velocities = fem::Vec::Zero(3 * body.nodeCount());
  for (int i = 0; i < body.nodeCount(); ++i) {
    if (body.isFixed(i)) continue;
    velocities.segment<3>(3 * i) = velocity.row(body_->nearest[i]).transpose();
  }
  body.setState(body_->rest_positions, velocities);
  soft.changed();
  std::vector<Vertices> surfaces{soft.vertices()};
  for (size_t k = 1; k < times.size(); ++k) {
    const double h = (times[k] - times[k - 1]) / kSubsteps;
    for (int s = 0; s < kSubsteps; ++s) {
      const fem::Vec v = body.surfaceVelocities();
      const Vertices forces =
          windForces(surface_, soft.vertices(), Eigen::Map<const Vertices>(v.data(), v.size() / 3, 3),
                     wind(times[k - 1] + (s + 1) * h), drag_);
      for (int i = 0; i < forces.rows(); ++i) {
        soft.addForce(fem::SurfacePoint::vertex(i), forces.row(i).transpose());
      }
      soft.step(h);
    }
    surfaces.push_back(soft.vertices());
  }
  return surfaces;
}

}  // namespace calipso::flow

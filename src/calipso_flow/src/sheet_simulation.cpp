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
  settle(gravity);
  start_ = sheet_.body().positions();
}

void SheetSimulation::settle(const Eigen::Vector3d& gravity) {
  std::vector<fem::HoldPoint> hold;
  try {
    const fem::SettleReport report = sheet_.settle(gravity, hold, kSag * boundingDiagonal(surface_));
    if (!report.message.empty()) throw NoEquilibrium(report.message);
  } catch (const std::invalid_argument& inverted) {  // by a rest shape that would have to be folded
    throw NoEquilibrium(inverted.what());
  }
}

fem::Air SheetSimulation::airOf(const Eigen::Vector3d& wind) const {
  return {wind, (closed_ ? 0.5 : 1.0) * fem::kAirDrag};
}

void SheetSimulation::blow(const Eigen::Vector3d& wind, double h) {
  const Eigen::VectorXd positions = sheet_.body().surfaceVertices();
  const Eigen::VectorXd velocities = sheet_.body().surfaceVelocities();
  const Eigen::Index count = positions.size() / 3;
  const fem::Vertices forces = fem::windForces(
      Eigen::Map<const fem::Vertices>(positions.data(), count, 3),
      Eigen::Map<const fem::Vertices>(velocities.data(), count, 3), surface_.triangles, airOf(wind),
      areal_density_, h);
  sheet_.body().setSurfaceForces(Eigen::Map<const Eigen::VectorXd>(forces.data(), forces.size()));
}

void SheetSimulation::move(const std::vector<double>& times, const SurfaceVector& velocities, const Wind& wind,
                           const AfterStep& after_step, const std::function<void()>& after_frame) {
  fem::DeformableBody& body = sheet_.body();
  body.setState(start_, sheet_.nodalField(velocities));
  after_frame();
  for (size_t k = 1; k < times.size(); ++k) {
    const double span = times[k] - times[k - 1];
    const int steps = std::max(1, static_cast<int>(std::ceil(span / longest_step_ - 1e-6)));
    const double h = span / steps;
    for (int s = 0; s < steps; ++s) {
      const double middle = times[k - 1] + (s + 0.5) * h;
      const fem::Vec x0 = body.positions(), v0 = body.velocities();
      blow(wind(middle), h);
      body.step(h);
      if (after_step) after_step(x0, v0, middle, h);
    }
    after_frame();
  }
}

std::vector<SurfaceVector> SheetSimulation::run(const std::vector<double>& times,
                                                const SurfaceVector& velocities, const Wind& wind) {
  std::vector<SurfaceVector> shapes;
  move(times, velocities, wind, nullptr, [&] { shapes.push_back(sheet_.body().surfaceVertices()); });
  const SurfaceVector first = shapes.front();
  for (SurfaceVector& shape : shapes) shape -= first;
  return shapes;
}

SheetMotion SheetSimulation::measure(const std::vector<double>& times, const SurfaceVector& velocities,
                                     const WindCourse& wind, const Eigen::MatrixXd& measured,
                                     const SheetSimulation* stiffer, double by) {
  const fem::DeformableBody& body = sheet_.body();
  const int winds = stiffer ? 3 * static_cast<int>(wind.knots.size()) : 0, parameters = stiffer ? winds + 1 : 0;
  Eigen::MatrixXd nodal(measured.rows(), 3 * body.nodeCount());
  for (Eigen::Index m = 0; m < measured.rows(); ++m) {
    nodal.row(m) = body.embedding().applyTransposed(measured.row(m).transpose()).transpose();
  }
  MotionTangent tangent(body, parameters);
  SheetMotion motion;
  motion.amplitudes.resize(times.size(), measured.rows());
  motion.slopes.assign(parameters, Eigen::MatrixXd(times.size(), measured.rows()));
  const Eigen::VectorXd viscosity = Eigen::VectorXd::Unit(std::max(1, parameters), std::max(0, parameters - 1));
  const AfterStep carry = [&](const fem::Vec& x0, const fem::Vec& v0, double time, double h) {
    Eigen::MatrixXd dw = Eigen::MatrixXd::Zero(3, parameters);
    for (size_t i = 0; i < wind.knots.size(); ++i) {
      dw.middleCols<3>(3 * i) = wind.weight(i, time) * Eigen::Matrix3d::Identity();
    }
    Eigen::MatrixXd dF = windSlopes(x0, v0, wind.at(time), h, tangent, dw);
    fem::Vec own, other;
    body.model().gradient(body.positions(), own);
    stiffer->sheet_.body().model().gradient(body.positions(), other);
    dF.col(winds) -= (other - own) / by;
    tangent.advance(x0, h, dF, viscosity);
  };
  Eigen::Index frame = 0;
  const auto see = [&] {
    motion.amplitudes.row(frame) = (nodal * (body.positions() - start_)).transpose();
    const Eigen::MatrixXd seen = nodal * tangent.positions();
    for (int p = 0; p < parameters; ++p) motion.slopes[p].row(frame) = seen.col(p).transpose();
    ++frame;
  };
  move(times, velocities, [&](double time) { return wind.at(time); }, stiffer ? carry : AfterStep(), see);
  return motion;
}

Eigen::MatrixXd SheetSimulation::windSlopes(const fem::Vec& x0, const fem::Vec& v0, const Eigen::Vector3d& wind,
                                            double h, const MotionTangent& tangent, const Eigen::MatrixXd& dw) const {
  const fem::Embedding& embedding = sheet_.body().embedding();
  Eigen::MatrixXd dx(3 * embedding.vertexCount(), dw.cols()), du(dx.rows(), dx.cols());
  for (Eigen::Index p = 0; p < dw.cols(); ++p) {
    dx.col(p) = embedding.apply(tangent.positions().col(p));
    du.col(p) = embedding.apply(tangent.velocities().col(p));
  }
  const Eigen::MatrixXd forces = windForceSlopes(embedding.apply(x0), embedding.apply(v0), surface_.triangles,
                                                 airOf(wind), areal_density_, h, dx, du, dw);
  Eigen::MatrixXd result(x0.size(), dw.cols());
  for (Eigen::Index p = 0; p < dw.cols(); ++p) result.col(p) = embedding.applyTransposed(forces.col(p));
  return result;
}

}  // namespace calipso::flow

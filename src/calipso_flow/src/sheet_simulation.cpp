#include "sheet_simulation.hpp"

#include <calipso_fem/world/mass_properties.hpp>
#include <calipso_fem/world/wind.hpp>
#include <calipso_fem/world/world_types.hpp>
#include <cmath>
#include <stdexcept>

namespace calipso::flow {
namespace {

constexpr double kTolerance = 1e-3;  // of a step: residual over loads and inner forces
constexpr double kSkin = 0.5;        // edge of a coarse skin's cubes over that of a cell

TriangleMesh inWorld(const ObjectModel& model) {
  TriangleMesh mesh = model.mesh;
  mesh.vertices = (mesh.vertices * model.world_from_object.linear().transpose()).rowwise() +
                  model.world_from_object.translation().transpose();
  return mesh;
}

Material softened(const TriangleMesh& surface, const Eigen::Vector3d& gravity, double stiffness) {
  Material material = defaultMaterial(boundingDiagonal(surface), gravity.norm());
  material.youngs_modulus *= stiffness;
  return material;
}

fem::FemOptions optionsFor(const SheetSettings& settings) {
  fem::FemOptions options;
  options.target_nodes = settings.nodes;
  options.cell_size = settings.cell_size;
  options.threads = 1;
  options.newton_tolerance = kTolerance;
  options.newton_iterations = 8;
  return options;
}

}  // namespace

SheetSimulation::SheetSimulation(const ObjectModel& model, const Eigen::Vector3d& gravity,
                                 const SheetSettings& settings, const SheetSimulation* like)
    : longest_step_(settings.longest_step),
      surface_(inWorld(model)),
      sheet_(surface_, softened(surface_, gravity, settings.stiffness), optionsFor(settings)),
      skin_(surface_, sheet_.body().grid(),
            settings.coarse_skin ? kSkin * sheet_.body().grid().cell_size : 0.0) {
  const Material material = softened(surface_, gravity, settings.stiffness);
  stiffness_over_density_ = material.youngs_modulus / material.density;
  areal_density_ =
      sheet_.body().totalMass() / ((fem::isClosed(surface_) ? 0.5 : 1.0) * surfaceArea(surface_));
  if (!model.attached.empty()) sheet_.body().fixSurfaceVertices(model.attached);
  sheet_.setGravity(gravity);
  if (like) sheet_.body().setRestNodes(like->sheet_.body().model().mesh().nodes);
  settle(gravity, settings.sag * boundingDiagonal(surface_));
  start_ = sheet_.body().positions();
  step_.emplace(sheet_.body());
}

void SheetSimulation::settle(const Eigen::Vector3d& gravity, double sag) {
  std::vector<fem::HoldPoint> hold;
  try {
    const fem::SettleReport report = sheet_.settle(gravity, hold, sag);
    if (!report.message.empty()) throw NoEquilibrium(report.message);
  } catch (const std::invalid_argument& inverted) {  // by a rest shape that would have to be folded
    throw NoEquilibrium(inverted.what());
  }
}

void SheetSimulation::blow(const Eigen::Vector3d& wind, double h) {
  fem::DeformableBody& body = sheet_.body();
  const Eigen::VectorXd x = skin_.embedding.apply(body.positions()),
                        u = skin_.embedding.apply(body.velocities());
  const Eigen::Index count = x.size() / 3;
  const fem::Vertices forces =
      fem::windForces(Eigen::Map<const fem::Vertices>(x.data(), count, 3),
                      Eigen::Map<const fem::Vertices>(u.data(), count, 3), skin_.triangles,
                      {wind, skin_.drag}, areal_density_, h);
  body.setNodalForces(skin_.embedding.applyTransposed(
      Eigen::Map<const Eigen::VectorXd>(forces.data(), forces.size())));
}

void SheetSimulation::move(const std::vector<double>& times, const SurfaceVector& displacements,
                           const SurfaceVector& velocities, const Wind& wind, const InStep& in_step,
                           const std::function<void()>& after_frame) {
  fem::DeformableBody& body = sheet_.body();
  body.setState(start_ + sheet_.nodalField(displacements), sheet_.nodalField(velocities));
  step_->restart();
  after_frame();
  for (size_t k = 1; k < times.size(); ++k) {
    const double span = times[k] - times[k - 1];
    const int steps = std::max(1, static_cast<int>(std::ceil(span / longest_step_ - 1e-6)));
    const double h = span / steps;
    for (int s = 0; s < steps; ++s) {
      const double middle = times[k - 1] + (s + 0.5) * h;
      blow(wind(middle), h);
      step_->advance(h, kTolerance);
      if (in_step) in_step(middle, h);
      body.endStep(fem::Vec::Zero(start_.size()));
    }
    after_frame();
  }
}

std::vector<SurfaceVector> SheetSimulation::run(const std::vector<double>& times,
                                                const SurfaceVector& velocities, const Wind& wind) {
  std::vector<SurfaceVector> shapes;
  move(times, SurfaceVector::Zero(velocities.size()), velocities, wind, nullptr,
       [&] { shapes.push_back(sheet_.body().surfaceVertices()); });
  const SurfaceVector first = shapes.front();
  for (SurfaceVector& shape : shapes) shape -= first;
  return shapes;
}

SheetMotion SheetSimulation::measure(const std::vector<double>& times,
                                     const SurfaceVector& displacements,
                                     const SurfaceVector& velocities, const WindCourse& wind,
                                     const Eigen::MatrixXd& measured,
                                     const SheetSimulation* stiffer, double by) {
  const fem::DeformableBody& body = sheet_.body();
  const int winds = stiffer ? 3 * static_cast<int>(wind.knots.size()) : 0,
            parameters = stiffer ? winds + 1 : 0;
  Eigen::MatrixXd nodal(measured.rows(), 3 * body.nodeCount());
  for (Eigen::Index m = 0; m < measured.rows(); ++m) {
    nodal.row(m) = body.embedding().applyTransposed(measured.row(m).transpose()).transpose();
  }
  MotionTangent tangent(static_cast<int>(nodal.cols()), parameters);
  SheetMotion motion;
  motion.amplitudes.resize(times.size(), measured.rows());
  motion.slopes.assign(parameters, Eigen::MatrixXd(times.size(), measured.rows()));
  const Eigen::VectorXd viscosity =
      Eigen::VectorXd::Unit(std::max(1, parameters), std::max(0, parameters - 1));
  const InStep carry = [&](double time, double h) {
    Slopes dw = Slopes::Zero(3, parameters);
    for (size_t i = 0; i < wind.knots.size(); ++i) {
      dw.middleCols<3>(3 * i) = wind.weight(i, time) * Eigen::Matrix3d::Identity();
    }
    Slopes dF = windSlopes(wind.at(time), h, tangent, dw);
    fem::Vec own, other;
    body.model().gradient(body.trialPositions(), own);
    stiffer->sheet_.body().model().gradient(body.trialPositions(), other);
    dF.col(winds) -= (other - own) / by;
    tangent.advance(*step_, body.trialPositions() - body.positions(), h, dF, viscosity);
  };
  Eigen::Index frame = 0;
  const auto see = [&] {
    motion.amplitudes.row(frame) = (nodal * (body.positions() - start_)).transpose();
    const Eigen::MatrixXd seen = nodal * tangent.positions();
    for (int p = 0; p < parameters; ++p) motion.slopes[p].row(frame) = seen.col(p).transpose();
    ++frame;
  };
  move(
      times, displacements, velocities, [&](double time) { return wind.at(time); },
      stiffer ? carry : InStep(), see);
  return motion;
}

Slopes SheetSimulation::windSlopes(const Eigen::Vector3d& wind, double h,
                                   const MotionTangent& tangent, const Slopes& dw) const {
  const fem::DeformableBody& body = sheet_.body();
  const auto& weights = skin_.embedding.weights;
  Slopes dx = Slopes::Zero(3 * weights.rows(), dw.cols()), du = dx;
  using Entry = Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator;
  for (int v = 0; v < weights.rows(); ++v) {
    for (Entry it(weights, v); it; ++it) {
      dx.middleRows<3>(3 * v) += it.value() * tangent.positions().middleRows<3>(3 * it.col());
      du.middleRows<3>(3 * v) += it.value() * tangent.velocities().middleRows<3>(3 * it.col());
    }
  }
  const Slopes forces = windForceSlopes(skin_.embedding.apply(body.positions()),
                                        skin_.embedding.apply(body.velocities()), skin_.triangles,
                                        {wind, skin_.drag}, areal_density_, h, dx, du, dw);
  Slopes nodal = Slopes::Zero(3 * body.nodeCount(), dw.cols());
  for (int v = 0; v < weights.rows(); ++v) {
    for (Entry it(weights, v); it; ++it)
      nodal.middleRows<3>(3 * it.col()) += it.value() * forces.middleRows<3>(3 * v);
  }
  return nodal;
}

}  // namespace calipso::flow

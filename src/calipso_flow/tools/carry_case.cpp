#include "carry_case.hpp"

#include <algorithm>
#include <calipso_fem/world/world.hpp>
#include <cmath>

#include "world_case.hpp"

namespace calipso::flow {
namespace {

constexpr int kCarriedFrames = 10;

using Surface = decltype(fem::ObjectSnapshot::vertices);

// What the video shows.
void tellWhatIsSeen(const ObjectModel& model, const ObjectDynamics& dynamics, fem::World& world) {
  const DeformationModes& modes = dynamics.deformation->modes;
  world.addObservedModes(model.name, modes.shapes);
  for (size_t k = 0; k < dynamics.motions.size(); ++k) {
    fem::ObservedMotion seen;
    seen.time = dynamics.motions[k].state.time;
    seen.moving = true;
    seen.world_from_object = model.world_from_object;
    seen.mode_amplitudes = modes.amplitudes.row(k).transpose();
    seen.mode_velocities = modes.velocities.row(k).transpose();
    world.addObservedMotion(model.name, seen);
  }
}

// Shapes of the surface from frame `start` on, where it becomes deformable; world axes.
std::vector<Surface> carriedOn(const Scene& scene, const ObjectModel& model,
                               const ObjectDynamics& dynamics, int start) {
  fem::WorldParams params;
  params.frame_period = 1.0 / scene.fps;
  fem::World world(worldOf(scene, model), params);
  tellWhatIsSeen(model, dynamics, world);
  Edit edit;
  edit.time = start / scene.fps;
  edit.object = model.name;
  edit.kind = EditKind::kObjectKind;
  edit.object_kind = ObjectKind::kDeformable;
  world.submit(edit);
  std::vector<Surface> shapes;
  for (int k = 0; k <= start + kCarriedFrames; ++k) {
    world.advanceTo(k / scene.fps);
    if (k >= start) shapes.push_back(world.state().objects.front().vertices);
  }
  return shapes;
}

// The part of the measured velocities with which the simulated surface sets out.
double speedKept(const ObjectModel& model, const DeformationModes& modes, int start, double fps,
                 const std::vector<Surface>& shapes) {
  Eigen::VectorXd measured = modes.shapes * modes.velocities.row(start).transpose();
  Eigen::Map<Eigen::Matrix3Xd> columns(measured.data(), 3, measured.size() / 3);
  columns = (model.world_from_object.linear() * columns).eval();
  const Surface moved = fps * (shapes[1] - shapes[0]);
  const Eigen::Map<const Eigen::VectorXd> simulated(moved.data(), moved.size());
  return simulated.dot(measured) / measured.squaredNorm();
}

// Way of the mean of the lower edge (within 5 % of the height) from the first of the shapes.
Eigen::MatrixXd edgeWay(const std::vector<Surface>& shapes, const Surface& rest,
                        const Eigen::Vector3d& gravity) {
  const Eigen::VectorXd depth = rest * gravity.normalized();
  const double edge = depth.maxCoeff() - 0.05 * (depth.maxCoeff() - depth.minCoeff());
  const double count = static_cast<double>((depth.array() >= edge).count());
  Eigen::MatrixXd way = Eigen::MatrixXd::Zero(shapes.size(), 3);
  for (size_t k = 0; k < shapes.size(); ++k) {
    for (int i = 0; i < depth.size(); ++i) {
      if (depth[i] >= edge) way.row(k) += (shapes[k].row(i) - shapes[0].row(i)) / count;
    }
  }
  return way;
}

std::vector<Surface> trueShapes(const ObjectModel& model, const TrueObject& truth, int start) {
  std::vector<Surface> shapes;
  for (int k = start; k <= start + kCarriedFrames; ++k) {
    shapes.emplace_back(
        (truth.vertices[k] * model.world_from_object.linear().transpose()).rowwise() +
        model.world_from_object.translation().transpose());
  }
  return shapes;
}

// As the tracking has them: what is carried on cannot be nearer to the truth.
std::vector<Surface> seenShapes(const ObjectModel& model, const DeformationModes& modes,
                                int start) {
  std::vector<Surface> shapes;
  for (int k = start; k <= start + kCarriedFrames; ++k) {
    const Surface seen = modes.surface(model.mesh, modes.amplitudes.row(k).transpose());
    shapes.emplace_back((seen * model.world_from_object.linear().transpose()).rowwise() +
                        model.world_from_object.translation().transpose());
  }
  return shapes;
}

}  // namespace

void addCarriedOn(const Scene& scene, const ObjectModel& model, const TrueObject& truth,
                  const ObjectDynamics& dynamics, JsonEntry& entry) {
  const int last = static_cast<int>(dynamics.motions.size()) - 1 - kCarriedFrames;
  if (last < 1) return;
  const DeformationModes& modes = dynamics.deformation->modes;
  const Surface rest =
      (model.mesh.vertices * model.world_from_object.linear().transpose()).rowwise() +
      model.world_from_object.translation().transpose();
  double speed = 0.0, error = 0.0, simulated = 0.0, real = 0.0, product = 0.0, seen_error = 0.0;
  for (const int start : {last / 2, last}) {
    const std::vector<Surface> shapes = carriedOn(scene, model, dynamics, start);
    speed += 0.5 * speedKept(model, modes, start, scene.fps, shapes);
    const Eigen::MatrixXd way = edgeWay(shapes, rest, scene.gravity),
                          truly = edgeWay(trueShapes(model, truth, start), rest, scene.gravity);
    const Eigen::MatrixXd seen = edgeWay(seenShapes(model, modes, start), rest, scene.gravity);
    seen_error += (seen - truly).squaredNorm();
    error += (way - truly).squaredNorm(), simulated += way.squaredNorm(),
        real += truly.squaredNorm();
    product += (way.array() * truly.array()).sum();
  }
  entry.number("carried_speed", speed)
      .number("seen_edge_percent", 100.0 * std::sqrt(seen_error / real))
      .number("carried_edge_percent", 100.0 * std::sqrt(error / real))
      .number("carried_edge_correlation", product / std::sqrt(simulated * real));
}

}  // namespace calipso::flow

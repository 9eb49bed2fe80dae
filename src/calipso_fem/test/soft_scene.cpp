#include "soft_scene.hpp"

#include <algorithm>
#include <ctime>

namespace calipso::fem::test {
namespace {

double processMs() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e3 * t.tv_sec + 1e-6 * t.tv_nsec;
}

constexpr int kFirstRigid = 1000, kFirstMoving = 2000, kFirstPlane = 3000;  // ids

}  // namespace

TriangleMesh movedMesh(TriangleMesh mesh, const Eigen::Vector3d& by) {
  mesh.vertices.rowwise() += by.transpose();
  return mesh;
}

SoftObject& SoftScene::addSoft(const TriangleMesh& surface_mesh, const Material& material,
                               double cell_size, const Eigen::Vector3d& velocity,
                               const Eigen::Vector3d& angular) {
  FemOptions options;
  options.cell_size = cell_size;
  softs_.push_back(std::make_unique<SoftObject>(surface_mesh, material, options));
  SoftObject& soft = *softs_.back();
  soft.body().setRigidVelocity(velocity, angular);
  soft.setGravity(gravity);
  soft.changed();
  soft_surfaces_.push_back(surface);
  return soft;
}

void SoftScene::addPlane(const Eigen::Vector3d& normal, double offset) {
  planes_.push_back({{"plane", normal, offset, std::nullopt}, surface});
}

void SoftScene::addMoving(const TriangleMesh& mesh, PoseOverTime pose) {
  moving_.push_back({std::make_unique<SurfaceTree>(mesh), std::move(pose), surface});
}

RigidWorld::Id SoftScene::addRigid(const TriangleMesh& mesh, double density,
                                   const Eigen::Isometry3d& pose, const Eigen::Vector3d& velocity) {
  RigidBodySpec spec;
  spec.name = "rigid" + std::to_string(rigids_.size());
  spec.shapes = {mesh};
  spec.mass = massProperties(mesh, density);
  spec.surface = surface;
  spec.world_from_object = pose;
  spec.linear = velocity;
  const RigidWorld::Id id = rigid_.add(spec);
  rigid_.setAcceleration(id, gravity);
  rigids_.push_back({id, spec.mass, std::make_unique<SurfaceTree>(mesh), surface});
  return id;
}

std::vector<SoftEntry> SoftScene::entries() const {
  std::vector<SoftEntry> list;
  for (size_t i = 0; i < softs_.size(); ++i)
    list.push_back(
        {static_cast<int>(i), "soft" + std::to_string(i), soft_surfaces_[i], softs_[i].get()});
  return list;
}

std::vector<Obstacle> SoftScene::obstacles(double h) const {
  std::vector<Obstacle> list;
  const auto add = [&](int id, const std::string& name,
                       const SurfaceSettings& surface) -> Obstacle& {
    Obstacle o;
    o.id = id;
    o.name = name;
    o.surface = surface;
    return list.emplace_back(o);
  };
  const auto numbered = [](const char* kind, size_t i) { return kind + std::to_string(i); };
  for (size_t i = 0; i < softs_.size(); ++i) {
    Obstacle& o = add(static_cast<int>(i), numbered("soft", i), soft_surfaces_[i]);
    o.soft = softs_[i].get();
    o.tree = &softs_[i]->tree();
  }
  for (size_t i = 0; i < rigids_.size(); ++i) {
    Obstacle& o = add(kFirstRigid + static_cast<int>(i), numbered("rigid", i), rigids_[i].surface);
    o.tree = rigids_[i].tree.get();
    o.pose = o.previous_pose = rigid_.pose(rigids_[i].id);
    o.rigid = rigids_[i].id;
    o.acceleration = gravity;
  }
  for (size_t i = 0; i < moving_.size(); ++i) {
    Obstacle& o =
        add(kFirstMoving + static_cast<int>(i), numbered("moving", i), moving_[i].surface);
    o.tree = moving_[i].tree.get();
    o.previous_pose = moving_[i].pose(time_);
    o.pose = moving_[i].pose(time_ + h);
  }
  for (size_t i = 0; i < planes_.size(); ++i)
    add(kFirstPlane + static_cast<int>(i), planes_[i].first.name, planes_[i].second).plane =
        &planes_[i].first;
  return list;
}

void SoftScene::step(double h) {
  const std::vector<Obstacle> around = obstacles(h);
  const double start = processMs();
  report_ = contacts_.step(entries(), around, rigid_, h);
  if (report_.bodies.empty()) {  // given up
    cpu_ms_ += processMs() - start;
    step(0.5 * h);
    step(0.5 * h);
    return;
  }
  rigid_.step(h);
  cpu_ms_ += processMs() - start;
  for (const ContactPoint& c : contacts_.contacts()) deepest_ = std::max(deepest_, c.depth);
  time_ += h;
}

double SoftScene::energy() const {
  double sum = 0.0;
  for (const auto& s : softs_)
    sum += s->body().kineticEnergy() + s->body().elasticEnergy() + s->body().gravityEnergy();
  for (const Rigid& r : rigids_)
    sum += rigid_.kineticEnergy(r.id) - r.mass.mass * gravity.dot(rigid_.center(r.id));
  return sum;
}

Eigen::Matrix<double, 6, 1> SoftScene::momentum() const {
  Eigen::Matrix<double, 6, 1> total = Eigen::Matrix<double, 6, 1>::Zero();
  const auto add = [&](const Eigen::Vector3d& linear, const Eigen::Vector3d& angular,
                       const Eigen::Vector3d& center) {
    total.head<3>() += linear;
    total.tail<3>() += angular + center.cross(linear);
  };
  for (const auto& s : softs_) {
    const Momentum m = s->body().momentum();
    add(m.linear, m.angular, m.center);
  }
  for (const Rigid& r : rigids_) {
    const Eigen::Matrix3d R = rigid_.pose(r.id).linear();
    add(r.mass.mass * rigid_.linearVelocity(r.id),
        R * r.mass.inertia * R.transpose() * rigid_.angularVelocity(r.id), rigid_.center(r.id));
  }
  return total;
}

}  // namespace calipso::fem::test

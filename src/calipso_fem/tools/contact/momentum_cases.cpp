#include <algorithm>
#include <stdexcept>

#include "contact_cases.hpp"

// Collisions in free flight: momentum is kept, energy never grows.
namespace calipso::fem {
namespace {

using test::boxSurface;
using test::movedMesh;
using test::SoftScene;

const Material kSoft{1e5, 0.3, 1000.0, 0.005};

std::vector<Result> collide(SoftScene& scene, const std::string& what) {
  const Eigen::Matrix<double, 6, 1> before = scene.momentum();
  const double e0 = scene.energy();
  double growth = 0.0;
  int touches = 0;
  const int steps = 60;
  for (int k = 0; k < steps; ++k) {
    scene.step(1.0 / 120.0);
    touches += scene.report().contacts;
    growth = std::max(growth, scene.energy() / e0 - 1.0);
  }
  if (touches == 0) throw std::runtime_error(what + ": the two did not meet");
  const Eigen::Matrix<double, 6, 1> after = scene.momentum();
  const double ms = scene.cpuMs() / steps * 4.0, ratio = scene.deepest() / 5e-3;
  const auto change = [&](int at) {
    return (after - before).segment<3>(at).norm() / before.segment<3>(at).norm();
  };
  return {{"change of linear momentum, relative, " + what, change(0), 0.0, ratio, growth, ms},
          {"change of angular momentum, relative, " + what, change(3), 0.0, ratio, growth, ms}};
}

std::vector<Result> softMeetsSoft() {
  SoftScene scene;
  scene.gravity.setZero();
  scene.addSoft(boxSurface({0.2, 0.2, 0.2}, 4), kSoft, 0.05, {1, 0, 0}, {0, 0.5, 0.2});
  scene.addSoft(movedMesh(boxSurface({0.2, 0.2, 0.2}, 4), {0.25, 0.05, 0.03}), kSoft, 0.05);
  return collide(scene, "two deformable blocks");
}

std::vector<Result> softMeetsRigid() {
  SoftScene scene;
  scene.gravity.setZero();
  scene.addSoft(boxSurface({0.2, 0.2, 0.2}, 4), kSoft, 0.05, {1, 0, 0}, {0, 0.5, 0.2});
  scene.addRigid(boxSurface({0.2, 0.2, 0.2}, 4), 1000.0,
                 Eigen::Isometry3d(Eigen::Translation3d(0.25, 0.05, 0.03)));
  return collide(scene, "a deformable and a rigid block");
}

}  // namespace

Cases momentumCases() {
  return {{"soft_soft_momentum", softMeetsSoft}, {"soft_rigid_momentum", softMeetsRigid}};
}

}  // namespace calipso::fem

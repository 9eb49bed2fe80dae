#include "view_change.hpp"

#include <algorithm>
#include <cmath>

#include "calipso_flow/rotation.hpp"

namespace calipso::flow {

ImageMotion imageMotion(const Camera& camera, const Eigen::Isometry3d& a,
                        const Eigen::Isometry3d& b, const std::vector<Eigen::Vector3d>& points) {
  const Eigen::Isometry3d camera_from_world = camera.world_from_camera.inverse();
  std::vector<Eigen::Vector2d> motions;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d pa = camera_from_world * (a * point),
                          pb = camera_from_world * (b * point);
    if (pa.z() <= 0.0 || pb.z() <= 0.0) continue;
    motions.push_back(camera.project(pb) - camera.project(pa));
    sum += motions.back();
  }
  ImageMotion motion;
  for (const Eigen::Vector2d& each : motions) {
    motion.largest = std::max(motion.largest, each.norm());
    motion.bend = std::max(motion.bend, (each - sum / static_cast<double>(motions.size())).norm());
  }
  return motion;
}

double viewChange(const Eigen::Isometry3d& then, const Eigen::Isometry3d& now,
                  const Eigen::Vector3d& centroid) {
  const double turn = vectorFromRotation(now.linear() * then.linear().transpose()).norm();
  return std::hypot(turn, std::log((now * centroid).norm() / (then * centroid).norm()));
}

double viewChange(const ReferenceView& reference, const Frame& frame, const Eigen::Isometry3d& pose,
                  const Eigen::Vector3d& centroid) {
  return viewChange(
      reference.frame().camera.world_from_camera.inverse() * reference.worldFromObject(),
      frame.camera.world_from_camera.inverse() * pose, centroid);
}

int seedsInPicture(const ReferenceView& reference, const Camera& camera,
                   const Eigen::Isometry3d& pose) {
  const Eigen::Isometry3d camera_from_object = camera.world_from_camera.inverse() * pose;
  return static_cast<int>(std::count_if(
      reference.seeds().begin(), reference.seeds().end(), [&](const Eigen::Vector3d& seed) {
        const Eigen::Vector3d p = camera_from_object * seed;
        if (p.z() <= 0.0) return false;
        const Eigen::Vector2d at = camera.project(p);
        return at.x() >= 0.0 && at.y() >= 0.0 && at.x() < camera.width && at.y() < camera.height;
      }));
}

}  // namespace calipso::flow

#pragma once

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_flow/frame.hpp"
#include "calipso_flow/object_model.hpp"
#include "calipso_flow/surface_view.hpp"

// Small synthetic pictures of a textured box, moved as a test wants it.
namespace calipso::flow::test {

inline Camera testCamera() {
  Camera camera;
  camera.width = 320, camera.height = 240;
  camera.fx = camera.fy = 400.0;
  camera.cx = 159.5, camera.cy = 119.5;
  // Looks along world +y, z up, from 2 m in front of the origin.
  camera.world_from_camera.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  camera.world_from_camera.translation() << 0.0, -2.0, 0.0;
  return camera;
}

// A box of the given size about the origin, faces outwards.
inline TriangleMesh boxMesh(const Eigen::Vector3d& size) {
  TriangleMesh mesh;
  mesh.vertices.resize(8, 3);
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.row(i) << (i & 1 ? 0.5 : -0.5) * size.x(), (i & 2 ? 0.5 : -0.5) * size.y(),
        (i & 4 ? 0.5 : -0.5) * size.z();
  }
  mesh.triangles.resize(12, 3);
  mesh.triangles << 0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2,
      2, 4, 6, 1, 3, 5, 3, 7, 5;
  return mesh;
}

inline ObjectModel boxModel() {
  ObjectModel model;
  model.name = "box";
  model.index = 1;
  model.mesh = boxMesh({0.5, 0.4, 0.4});
  model.world_from_object.linear() =
      Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return model;
}

// A smooth solid texture: grey as a function of the point in the object's frame (wavelengths of
// 4 to 12 cm, 8 to 24 px in these pictures).
inline double textureAt(const Eigen::Vector3d& p) {
  return 128.0 + 35.0 * std::sin(90.0 * p.x() + 40.0 * p.z()) +
         35.0 * std::sin(110.0 * p.z() - 60.0 * p.y() + 1.0) +
         25.0 * std::sin(70.0 * p.x() - 80.0 * p.z() + 50.0 * p.y());
}

// A still, textured background, shifted by `scroll` px when a test wants it to move.
inline double backgroundAt(double u, double v, double scroll) {
  return 120.0 + 30.0 * std::sin(0.21 * (u - scroll)) * std::cos(0.17 * v) + 0.1 * v;
}

// The picture of the model at a pose, with Gaussian noise of `noise` grey levels.
inline cv::Mat render(const ObjectModel& model, const Eigen::Isometry3d& world_from_object,
                      const Camera& camera, double noise, uint64_t seed, double scroll = 0.0) {
  constexpr int kOver = 2;  // samples per pixel and direction
  Camera fine = camera;
  fine.width *= kOver, fine.height *= kOver;
  fine.fx *= kOver, fine.fy *= kOver;
  fine.cx = kOver * (camera.cx + 0.5) - 0.5, fine.cy = kOver * (camera.cy + 0.5) - 0.5;
  const Eigen::Isometry3d camera_from_object =
      camera.world_from_camera.inverse() * world_from_object;
  const SurfaceView view = viewSurface(model.mesh, fine, camera_from_object);
  cv::Mat big(fine.height, fine.width, CV_32F);
  for (int v = 0; v < fine.height; ++v) {
    for (int u = 0; u < fine.width; ++u) {
      const float depth = view.empty() ? 0.0f : view.depthAt(u, v);
      const double grey = depth > 0.0f
                              ? textureAt(camera_from_object.inverse() * (depth * fine.ray(u, v)))
                              : backgroundAt(u / 2.0, v / 2.0, scroll);
      big.at<float>(v, u) = static_cast<float>(grey);
    }
  }
  cv::Mat picture, noisy;
  cv::resize(big, picture, {camera.width, camera.height}, 0, 0, cv::INTER_AREA);
  cv::RNG rng(seed);
  cv::Mat grain(picture.size(), CV_32F);
  rng.fill(grain, cv::RNG::NORMAL, 0.0, noise > 0.0 ? noise : 1e-9);
  cv::Mat(picture + grain).convertTo(noisy, CV_8U);
  return noisy;
}

}  // namespace calipso::flow::test

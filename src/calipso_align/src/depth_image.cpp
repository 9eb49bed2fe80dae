#include "calipso_align/depth_image.hpp"

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace calipso::align {

std::optional<DepthObservation> loadDepth(const Scene& scene) {
  if (scene.depth_path.empty()) return std::nullopt;
  const cv::Mat raw = cv::imread(scene.depth_path, cv::IMREAD_UNCHANGED);
  if (raw.empty()) {
    throw std::runtime_error(scene.depth_path +
                             " cannot be read as a picture: replace or remove it");
  }
  if (raw.type() != CV_16UC1 || raw.cols != scene.camera.width || raw.rows != scene.camera.height) {
    throw std::runtime_error(scene.depth_path + " is " + std::to_string(raw.cols) + "x" +
                             std::to_string(raw.rows) + " with " + std::to_string(raw.channels()) +
                             " channels of " + std::to_string(8 * raw.elemSize1()) +
                             " bits: a depth image has one of 16 bits and the camera's size, " +
                             std::to_string(scene.camera.width) + "x" +
                             std::to_string(scene.camera.height));
  }
  DepthObservation observation;
  raw.convertTo(observation.depth, CV_32F, scene.depth_scale);
  return observation;
}

std::vector<cv::Mat> supportDepths(const std::vector<SupportPlane>& planes, const Camera& camera) {
  std::vector<cv::Mat> depths;
  const Eigen::Matrix3d R = camera.world_from_camera.linear();
  const Eigen::Vector3d eye = camera.world_from_camera.translation();
  for (const SupportPlane& plane : planes) {
    cv::Mat depth = cv::Mat::zeros(camera.height, camera.width, CV_32F);
    for (int v = 0; v < camera.height; ++v)
      for (int u = 0; u < camera.width; ++u) {
        const Eigen::Vector3d ray =
            R * Eigen::Vector3d((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1.0);
        const double z = (plane.offset - plane.normal.dot(eye)) / plane.normal.dot(ray);
        if (!std::isfinite(z) || z <= 0.0) continue;
        const double x = eye.x() + z * ray.x();
        if (plane.x_range && (x < plane.x_range->x() || x > plane.x_range->y())) continue;
        depth.at<float>(v, u) = static_cast<float>(z);
      }
    depths.push_back(depth);
  }
  return depths;
}

}  // namespace calipso::align

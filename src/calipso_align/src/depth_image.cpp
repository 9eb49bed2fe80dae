#include "calipso_align/depth_image.hpp"

#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace calipso::align {

std::optional<DepthObservation> loadDepth(const Scene& scene) {
  if (scene.depth_path.empty()) return std::nullopt;
  const cv::Mat raw = cv::imread(scene.depth_path, cv::IMREAD_UNCHANGED);
  if (raw.empty()) {
    throw std::runtime_error(scene.depth_path + " cannot be read as a picture: replace or remove it");
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

}  // namespace calipso::align

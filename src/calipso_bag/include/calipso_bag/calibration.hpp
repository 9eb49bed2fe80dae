#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "calipso_scene/camera.hpp"

namespace calipso::bag {

// What a camera's calibration file says.
struct Calibration {
  Camera camera;  // pose: identity
  // k1 k2 p1 p2 [k3 ...] (plumb_bob, rational_polynomial), of a fisheye k1 k2 k3 k4 (equidistant);
  // may be empty
  std::vector<double> distortion;
  bool fisheye = false;

  bool distorted() const;
};

// A pinhole camera with square pixels, seen from its middle. `fov_deg`: horizontal, in (1, 179).
// @throw std::invalid_argument naming the value and its range
Camera cameraFromFov(int width, int height, double fov_deg);

// Reads a calibration as camera_calibration writes it (image_width, camera_matrix, ...).
// @throw std::runtime_error naming file, key and remedy
Calibration loadCalibration(const std::string& path);

// The picture a camera without distortion, but with the same matrix, would have taken.
cv::Mat undistort(const cv::Mat& image, const Calibration& calibration);

}  // namespace calipso::bag

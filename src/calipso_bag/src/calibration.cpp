#include "calipso_bag/calibration.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <stdexcept>

namespace calipso::bag {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180.0;

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw std::runtime_error(path + ": " + what + "; write it as camera_calibration does");
}

template <typename T>
T read(const YAML::Node& root, const std::string& key, const std::string& path) {
  if (!root[key]) fail(path, "key '" + key + "' is missing");
  try {
    return root[key].as<T>();
  } catch (const YAML::Exception&) {
    fail(path, "key '" + key + "' cannot be read as a number");
  }
}

std::vector<double> readData(const YAML::Node& root, const std::string& key,
                             const std::string& path) {
  try {
    return root[key]["data"].as<std::vector<double>>();
  } catch (const YAML::Exception&) {
    fail(path, "key '" + key + "/data' is missing or not a list of numbers");
  }
}

YAML::Node parse(const std::string& path) {
  try {
    const YAML::Node root = YAML::LoadFile(path);
    if (!root.IsMap()) fail(path, "not a YAML map");
    return root;
  } catch (const YAML::Exception& e) {
    fail(path, std::string("cannot be read (") + e.what() + ")");
  }
}

}  // namespace

bool Calibration::distorted() const {
  return std::any_of(distortion.begin(), distortion.end(), [](double d) { return d != 0.0; });
}

Camera cameraFromFov(int width, int height, double fov_deg) {
  if (!(fov_deg > 1.0 && fov_deg < 179.0)) {
    throw std::invalid_argument("horizontal field of view " + std::to_string(fov_deg) +
                                " is outside (1, 179) degrees");
  }
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 0.5 * width / std::tan(0.5 * fov_deg * kDegree);
  camera.cx = 0.5 * (width - 1);
  camera.cy = 0.5 * (height - 1);
  return camera;
}

Calibration loadCalibration(const std::string& path) {
  const YAML::Node root = parse(path);
  Calibration calibration;
  Camera& camera = calibration.camera;
  camera.width = read<int>(root, "image_width", path);
  camera.height = read<int>(root, "image_height", path);
  const std::vector<double> k = readData(root, "camera_matrix", path);
  if (k.size() != 9 || !(k[0] > 0.0) || !(k[4] > 0.0)) {
    fail(path, "camera_matrix is not a 3x3 matrix with positive focal lengths");
  }
  camera.fx = k[0];
  camera.cx = k[2];
  camera.fy = k[4];
  camera.cy = k[5];
  if (root["distortion_coefficients"])
    calibration.distortion = readData(root, "distortion_coefficients", path);
  if (!root["distortion_model"]) return calibration;
  const std::string model = root["distortion_model"].as<std::string>();
  calibration.fisheye = model == "equidistant" || model == "fisheye";
  if (!calibration.fisheye && model != "plumb_bob" && model != "rational_polynomial")
    fail(path, "distortion_model is '" + model +
                   "'; it must be plumb_bob, rational_polynomial or equidistant");
  return calibration;
}

cv::Mat undistort(const cv::Mat& image, const Calibration& calibration) {
  const Camera& c = calibration.camera;
  const cv::Matx33d k(c.fx, 0.0, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0);
  cv::Mat straight;
  if (calibration.fisheye)
    cv::fisheye::undistortImage(image, straight, k, calibration.distortion, k);
  else
    cv::undistort(image, straight, k, calibration.distortion);
  return straight;
}

}  // namespace calipso::bag

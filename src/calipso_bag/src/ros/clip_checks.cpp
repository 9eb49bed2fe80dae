#include "clip_checks.hpp"

#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <array>
#include <iomanip>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <stdexcept>

#include "calipso_ros/conversions.hpp"

namespace calipso::bag {
namespace {

namespace enc = sensor_msgs::image_encodings;

std::string size(std::uint32_t width, std::uint32_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

[[noreturn]] void fail(const std::string& where, const std::string& what) {
  throw std::runtime_error(where + ": " + what);
}

}  // namespace

void checkPicture(const std::string& path, int bits, int width, int height) {
  if (path.empty()) return;
  const cv::Mat picture = cv::imread(path, cv::IMREAD_UNCHANGED);
  if (picture.empty()) fail(path, "no readable picture; replace or remove it");
  const bool is_deep = 8 * picture.elemSize1() == static_cast<std::size_t>(bits);
  if (is_deep && picture.cols == width && picture.rows == height) return;
  fail(path, "has " + size(picture.cols, picture.rows) + " pixels of " +
                 std::to_string(8 * picture.elemSize1()) + " bits; it takes " +
                 size(width, height) + " of " + std::to_string(bits) +
                 ", as the video has: replace or remove it");
}

void checkStrokes(const std::string& path, const std::set<int>& indices) {
  if (path.empty()) return;
  constexpr int kNone = 0, kBackground = 255;
  const cv::Mat1b strokes = cv::imread(path, cv::IMREAD_GRAYSCALE);
  for (const int value : std::set<int>(strokes.begin(), strokes.end())) {
    if (value == kNone || value == kBackground || indices.count(value) > 0) continue;
    std::string known;
    for (const int index : indices) known += (known.empty() ? "" : ", ") + std::to_string(index);
    fail(path, "value " + std::to_string(value) + " is the index of no object in scene.yaml (" +
                   known + "); list the object there, or erase its strokes (0)");
  }
}

void checkModelSize(const SceneObject& object, const TriangleMesh& model, const Camera& camera) {
  const double rect_px = object.rect.tail<2>().cast<double>().norm();
  if (rect_px <= 0.0 || model.vertexCount() == 0) return;
  // A model may be made anywhere in its frame: the farther of its middle and its origin counts.
  constexpr double kMostTimes = 20.0;  // a hidden or cut object's rectangle is smaller, too
  const Eigen::Isometry3d camera_from_object =
      camera.world_from_camera.inverse() * object.initial_world_from_object;
  const Eigen::Vector3d middle = model.vertices.colwise().mean().transpose();
  const double distance =
      std::max((camera_from_object * middle).norm(), camera_from_object.translation().norm());
  const double size = boundingDiagonal(model), size_px = camera.fx * size / distance;
  if (size_px < kMostTimes * rect_px && size_px * kMostTimes > rect_px) return;
  std::ostringstream what;
  what << std::setprecision(3) << "the model is " << size << " m large and " << distance
       << " m from the camera, which makes " << size_px << " px, but rect_xywh is " << rect_px
       << " px across; scale the model to metres (0.001 from millimetres), or correct "
       << "initial_world_T_object or rect_xywh of '" << object.name << "'";
  fail(object.cad_path, what.str());
}

void checkImage(const sensor_msgs::Image& image, const std::string& where) {
  static const std::array<std::string, 5> kKnown = {enc::RGB8, enc::BGR8, enc::RGBA8, enc::BGRA8,
                                                    enc::MONO8};
  if (std::find(kKnown.begin(), kKnown.end(), image.encoding) == kKnown.end()) {
    fail(where, "encoding '" + image.encoding +
                    "' is not known; convert to one of rgb8, bgr8, rgba8, bgra8, mono8 (image_proc "
                    "debayers raw images; 16 bits a channel take a scaling to 8)");
  }
  const std::size_t row = std::size_t{image.width} * enc::numChannels(image.encoding);
  if (image.width == 0 || image.height == 0 || image.step < row ||
      image.data.size() < std::size_t{image.step} * image.height) {
    fail(where, size(image.width, image.height) + " pixels in rows of " +
                    std::to_string(image.step) + " bytes do not fit its " +
                    std::to_string(image.data.size()) + " bytes; record the image again");
  }
  if (image.header.stamp.isZero()) {
    fail(where, "stamp 0; stamp the images with their time when recording");
  }
  if (image.header.frame_id.empty()) {
    fail(where, "frame_id is empty; name the camera's optical frame when recording");
  }
}

void checkFollows(const sensor_msgs::Image& image, const sensor_msgs::Image& first,
                  const ros::Time& previous, const std::string& where) {
  if (image.width != first.width || image.height != first.height) {
    fail(where, "size " + size(image.width, image.height) + " after " +
                    size(first.width, first.height) + "; a clip has one size: cut the bag there");
  }
  if (image.encoding != first.encoding) {
    fail(where, "encoding '" + image.encoding + "' after '" + first.encoding +
                    "'; a clip has one encoding");
  }
  if (image.header.frame_id != first.header.frame_id) {
    fail(where, "frame_id '" + image.header.frame_id + "' after '" + first.header.frame_id +
                    "'; a clip comes from one camera");
  }
  if (image.header.stamp <= previous) {
    fail(where, "stamp " + std::to_string(image.header.stamp.toSec()) + " s after " +
                    std::to_string(previous.toSec()) + " s; stamps must increase");
  }
}

void checkCameraInfo(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image,
                     const std::string& where) {
  if (info.width != image.width || info.height != image.height) {
    fail(where, "camera_info is for " + size(info.width, info.height) + " pixels, the image has " +
                    size(image.width, image.height) + "; calibrate for the recorded size");
  }
  try {
    fromMsg(info, Eigen::Isometry3d::Identity());
  } catch (const std::invalid_argument& e) {
    fail(where, e.what());
  }
}

}  // namespace calipso::bag

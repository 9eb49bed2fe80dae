#include "conversions.hpp"

#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <stdexcept>

#include "calipso_ros/conversions.hpp"

namespace calipso::render {

cv::Mat viewOf(const sensor_msgs::Image& image, PixelFormat format) {
  const std::size_t row = static_cast<std::size_t>(image.width) * channels(format);
  if (image.width == 0 || image.height == 0 || image.step < row ||
      image.data.size() < static_cast<std::size_t>(image.step) * (image.height - 1) + row) {
    throw std::invalid_argument(
        "image of " + std::to_string(image.width) + " x " + std::to_string(image.height) + ", " +
        image.encoding + ", step " + std::to_string(image.step) + " has " +
        std::to_string(image.data.size()) + " bytes, which do not fit; check the source");
  }
  return cv::Mat(static_cast<int>(image.height), static_cast<int>(image.width),
                 CV_8UC(channels(format)), const_cast<std::uint8_t*>(image.data.data()),
                 image.step);
}

cv::Mat bgrFromMsg(const sensor_msgs::Image& image) {
  const PixelFormat format = pixelFormat(image.encoding);
  return toBgr(viewOf(image, format), format);
}

cv::Mat labelsFromMsg(const sensor_msgs::Image& image) {
  if (image.encoding != sensor_msgs::image_encodings::MONO8) {
    throw std::invalid_argument("segmentation labels are " + image.encoding +
                                "; they must be mono8");
  }
  return viewOf(image, PixelFormat::kMono8).clone();
}

sensor_msgs::Image editedMsg(const sensor_msgs::Image& original, const FrameOutput& output) {
  sensor_msgs::Image edited = original;
  const PixelFormat format = pixelFormat(original.encoding);
  cv::Mat view = viewOf(edited, format);
  writeChanged(output.bgr, output.provenance, format, view);
  return edited;
}

sensor_msgs::Image imageMsg(const std_msgs::Header& header, const cv::Mat& image) {
  CV_Assert(image.depth() == CV_8U);
  sensor_msgs::Image msg;
  msg.header = header;
  msg.width = image.cols;
  msg.height = image.rows;
  msg.encoding = image.channels() == 1 ? sensor_msgs::image_encodings::MONO8
                                       : sensor_msgs::image_encodings::BGR8;
  msg.step = image.cols * image.channels();
  msg.data.resize(static_cast<std::size_t>(msg.step) * msg.height);
  for (int v = 0; v < image.rows; ++v)
    std::memcpy(&msg.data[static_cast<std::size_t>(v) * msg.step], image.ptr(v), msg.step);
  return msg;
}

std::vector<ObjectModel> fromMsg(const calipso_msgs::AlignedModels& models) {
  std::vector<ObjectModel> out;
  for (const calipso_msgs::AlignedModel& m : models.models) {
    out.push_back({m.object, m.index, calipso::fromMsg(m.mesh),
                   calipso::fromMsg(m.world_from_object.pose), calipso::fromMsg(m.cad)});
  }
  return out;
}

namespace {

std::optional<float> ifGiven(double value) {
  return std::isnan(value) ? std::nullopt : std::optional<float>(static_cast<float>(value));
}

Look fromMsg(const calipso_msgs::Look& msg) {
  Look look;
  const cv::Vec3f color(static_cast<float>(msg.color[2]), static_cast<float>(msg.color[1]),
                        static_cast<float>(msg.color[0]));
  const bool given =
      !std::isnan(msg.color[0]) && !std::isnan(msg.color[1]) && !std::isnan(msg.color[2]);
  if (given) (msg.color_is_absolute ? look.albedo : look.tint) = color;
  look.specular = ifGiven(msg.specular);
  look.roughness = ifGiven(msg.roughness);
  return look;
}

// Whether a frame says of an object that it moves, beyond what its pose is uncertain by.
bool movesInAny(const calipso_msgs::ClipDynamics& dynamics, const std::string& object) {
  return std::any_of(dynamics.frames.begin(), dynamics.frames.end(), [&](const auto& frame) {
    return std::any_of(frame.objects.begin(), frame.objects.end(),
                       [&](const auto& o) { return o.object == object && o.moving; });
  });
}

}  // namespace

PosesByStamp posesFromMsg(const calipso_msgs::ClipDynamics& dynamics,
                          const std::vector<ObjectModel>& models) {
  PosesByStamp poses;
  for (const calipso_msgs::Dynamics& frame : dynamics.frames) {
    std::vector<ObjectPose>& here = poses[nanoseconds(frame.header.stamp)];
    for (const calipso_msgs::ObjectDynamics& o : frame.objects) {
      const auto model = std::find_if(models.begin(), models.end(),
                                      [&](const ObjectModel& m) { return m.name == o.object; });
      const bool rigid = o.tracks > 0 && o.mode_amplitudes.empty();
      if (rigid && model != models.end())
        here.push_back({model->index, movesInAny(dynamics, o.object)
                                          ? calipso::fromMsg(o.world_from_object)
                                          : model->world_from_object});
    }
  }
  return poses;
}

SunChange sunFromMsg(const calipso_msgs::SimulationState& state) {
  SunChange sun;
  const Eigen::Vector3d direction = calipso::fromMsg(state.sun_direction);
  if (!direction.isZero()) sun.direction = direction.normalized().cast<float>();
  if (state.sun_factor > 0.0) sun.factor = static_cast<float>(state.sun_factor);
  return sun;
}

ObjectInFrame fromMsg(const calipso_msgs::ObjectState& state) {
  ObjectInFrame object;
  object.name = state.object;
  object.source = state.source;
  if (!state.look.empty()) object.look = fromMsg(state.look.front());
  object.edited = state.edited;
  object.removed = state.removed;
  object.world_from_object = calipso::fromMsg(state.pose);
  if (!state.observed_pose.empty()) object.observed = calipso::fromMsg(state.observed_pose.front());
  for (std::size_t i = 0; i + 2 < state.vertices.size(); i += 3) {
    object.vertices.emplace_back(state.vertices[i], state.vertices[i + 1], state.vertices[i + 2]);
  }
  for (std::size_t i = 0; i + 2 < state.triangles.size(); i += 3) {
    object.triangles.emplace_back(state.triangles[i], state.triangles[i + 1],
                                  state.triangles[i + 2]);
  }
  return object;
}

}  // namespace calipso::render

#include "camera_path.hpp"

#include <tf2/buffer_core.h>
#include <tf2/exceptions.h>
#include <tf2_msgs/TFMessage.h>

#include <stdexcept>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"
#include "open_bag.hpp"

namespace calipso::bag {
namespace {

const std::vector<std::string> kTfTopics = {"/tf", "tf", "/tf_static", "tf_static"};

// Fills the buffer with all the bag's transforms; returns how many there are.
int readTf(BagClip& clip, tf2::BufferCore& buffer) {
  int count = 0;
  try {
    rosbag::View view(clip.bag(), rosbag::TopicQuery(kTfTopics));
    for (const rosbag::MessageInstance& message : view) {
      const auto tf = message.instantiate<tf2_msgs::TFMessage>();
      if (!tf) continue;
      const bool is_static = message.getTopic().find("tf_static") != std::string::npos;
      for (const auto& transform : tf->transforms) {
        buffer.setTransform(transform, "bag", is_static);
        ++count;
      }
    }
  } catch (const rosbag::BagException& e) {
    throw damaged(clip.path(), e);
  }
  return count;
}

std::vector<geometry_msgs::TransformStamped> posesFromTf(const BagClip& clip,
                                                         const tf2::BufferCore& buffer) {
  std::vector<geometry_msgs::TransformStamped> poses;
  for (const ros::Time& stamp : clip.stamps()) {
    try {
      poses.push_back(buffer.lookupTransform(topics::kWorldFrame, clip.frameId(), stamp));
    } catch (const tf2::TransformException& e) {
      throw std::runtime_error(std::string("the bag's tf does not lead from '") +
                               topics::kWorldFrame + "' to '" + clip.frameId() + "' at " +
                               std::to_string(stamp.toSec()) + " s (" + e.what() +
                               "); record it, or use scene.yaml's pose with poses:=scene");
    }
    poses.back().header.stamp = stamp;
  }
  return poses;
}

std::vector<geometry_msgs::TransformStamped> posesFromScene(const BagClip& clip,
                                                            const Scene& scene) {
  const auto& moving = scene.world_from_camera_per_frame;
  if (scene.camera_moves && moving.empty()) {
    throw std::runtime_error(
        "the camera moves (camera_moving in scene.yaml), but nothing says where it is in each "
        "frame; record tf in the bag, or list world_T_camera_per_frame");
  }
  if (!moving.empty() && static_cast<int>(moving.size()) < clip.frameCount()) {
    throw std::runtime_error("the camera moves, but scene.yaml has poses for " +
                             std::to_string(moving.size()) + " of the bag's " +
                             std::to_string(clip.frameCount()) +
                             " frames; record tf in the bag, or shorten it");
  }
  std::vector<geometry_msgs::TransformStamped> poses;
  for (std::size_t i = 0; i < clip.stamps().size(); ++i) {
    geometry_msgs::TransformStamped pose;
    pose.header.frame_id = topics::kWorldFrame;
    pose.header.stamp = clip.stamps()[i];
    pose.child_frame_id = clip.frameId();
    pose.transform = toTransformMsg(moving.empty() ? scene.camera.world_from_camera : moving[i]);
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace

PoseSource poseSourceFromString(const std::string& name) {
  if (name == "auto") return PoseSource::kAuto;
  if (name == "bag") return PoseSource::kBag;
  if (name == "scene") return PoseSource::kScene;
  throw std::invalid_argument("poses is '" + name + "'; use auto, bag or scene");
}

CameraPath cameraPath(BagClip& clip, const Scene& scene, PoseSource source) {
  constexpr double kWholeClipSec = 1e6;
  tf2::BufferCore buffer{ros::Duration(kWholeClipSec)};
  const bool has_tf = source != PoseSource::kScene && readTf(clip, buffer) > 0;
  if (has_tf || source == PoseSource::kBag) return {posesFromTf(clip, buffer), "the bag's tf"};
  const std::string why = source == PoseSource::kScene ? "as asked for" : "the bag has no tf";
  return {posesFromScene(clip, scene), "scene.yaml (" + why + ")"};
}

}  // namespace calipso::bag

#include "ros/align_ros.hpp"

#include <cctype>
#include <numeric>
#include <stdexcept>

#include "calipso_align/depth_image.hpp"
#include "calipso_ros/conversions.hpp"
#include "calipso_ros/node_main.hpp"
#include "calipso_ros/same_message.hpp"
#include "calipso_ros/topics.hpp"
#include "ros/align_conversions.hpp"
#include "ros/segmentation_conversions.hpp"

namespace calipso::align {
namespace {

constexpr unsigned kUnlimited = 0;
constexpr bool kLatched = true;

// Graph names take letters, digits and underscores only.
std::string graphName(const std::string& object) {
  std::string name = object;
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  }
  return name;
}

// @throw std::invalid_argument naming two objects that would share a pose topic
void checkGraphNames(const std::vector<SceneObject>& objects) {
  std::map<std::string, std::string> owners;
  for (const SceneObject& object : objects) {
    const auto [owner, is_new] = owners.emplace(graphName(object.name), object.name);
    if (is_new) continue;
    throw std::invalid_argument("objects '" + owner->second + "' and '" + object.name +
                                "' would both have the topic align/initial_pose/" + owner->first +
                                "; name them otherwise");
  }
}

const calipso_msgs::ObjectContour* findContour(const calipso_msgs::Segmentation& segmentation,
                                               const std::string& object) {
  for (const calipso_msgs::ObjectContour& contour : segmentation.contours) {
    if (contour.object == object) return &contour;
  }
  return nullptr;
}

}  // namespace

AlignNodeParams loadAlignParams(const ros::NodeHandle& pnh) {
  AlignNodeParams params;
  params.scene = pathParam(pnh, "scene");
  params.levels = optionalParam(pnh, "levels", AlignOptions().levels);
  params.use_depth = optionalParam(pnh, "use_depth", params.use_depth);
  params.mode = modeParam(pnh);
  for (const int nodes : params.levels) {
    if (nodes < 8) {
      throw std::invalid_argument("parameter " + pnh.resolveName("levels") + " has " +
                                  std::to_string(nodes) + "; a grid needs 8 nodes or more");
    }
  }
  return params;
}

AlignRos::AlignRos(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : params_(loadAlignParams(pnh)), scene_(loadScene(params_.scene)), reporter_(nh, "align") {
  checkGraphNames(scene_.objects);
  options_.levels = params_.levels;
  // A live camera's first frame is not the picture that the depth image was taken with.
  if (params_.mode == Mode::kBag && params_.use_depth && !scene_.depth_path.empty())
    options_.depth = loadDepth(scene_);
  options_.planes = scene_.planes;
  models_publisher_ = nh.advertise<calipso_msgs::AlignedModels>(topics::kModels, 1, kLatched);
  markers_publisher_ = nh.advertise<visualization_msgs::MarkerArray>(
      topics::kMarkers, 1, [this](const ros::SingleSubscriberPublisher& subscriber) {
        if (key_) subscriber.publish(markers());
      });
  rerun_service_ = nh.advertiseService("align/rerun", &AlignRos::onRerun, this);
  pose_markers_ = std::make_unique<PoseMarkers>(
      nh.resolveName("align/rough_pose"),
      [this](int object, const Eigen::Isometry3d& pose) { moveTo(object, pose); });
  for (size_t k = 0; k < scene_.objects.size(); ++k) {
    const int object = static_cast<int>(k);
    const SceneObject& description = scene_.objects[k];
    models_.push_back(loadMesh(description.cad_path));
    pose_markers_->add(object, description, models_.back());
    pose_subscribers_.push_back(nh.subscribe<geometry_msgs::PoseStamped>(
        "align/initial_pose/" + graphName(description.name), 1,
        [this, object](const geometry_msgs::PoseStampedConstPtr& m) { onInitialPose(m, object); }));
  }
  clip_subscriber_ = nh.subscribe(topics::kClipInfo, 1, &AlignRos::onClipInfo, this);
  segmentation_subscriber_ =
      nh.subscribe(topics::kSegmentation, kUnlimited, &AlignRos::onSegmentation, this);
  reporter_.starting("waiting for the key frame's segmentation");
}

void AlignRos::onClipInfo(const calipso_msgs::ClipInfoConstPtr& msg) {
  if (!key_) {
    reporter_.starting("waiting for the segmentation of the first of " +
                       std::to_string(msg->frames) + " frames");
  }
}

// Only key frames carry contours. The same one comes again when a bag is played in a loop: who has
// forgotten its models then needs them again, and to all others they are nothing new.
void AlignRos::onSegmentation(const calipso_msgs::SegmentationConstPtr& msg) {
  if (msg->contours.empty()) return;
  if (key_ && sameMessage(*key_, *msg)) return publish();
  key_ = msg;
  fitAll();
}

void AlignRos::fitAll() {
  std::vector<int> all(scene_.objects.size());
  std::iota(all.begin(), all.end(), 0);
  fit(all);
}

void AlignRos::onInitialPose(const geometry_msgs::PoseStampedConstPtr& msg, int object) {
  try {
    if (msg->header.frame_id != topics::kWorldFrame) {
      throw std::invalid_argument("rough pose is given in frame '" + msg->header.frame_id +
                                  "'; give it in '" + topics::kWorldFrame + "'");
    }
    const Eigen::Isometry3d pose = calipso::fromMsg(msg->pose);
    pose_markers_->setPose(scene_.objects[object].name, pose);
    moveTo(object, pose);
  } catch (const std::exception& error) {
    reporter_.warn(msg->header.stamp, scene_.objects[object].name + ": " + error.what());
  }
}

void AlignRos::moveTo(int object, const Eigen::Isometry3d& world_from_object) {
  scene_.objects[object].initial_world_from_object = world_from_object;
  if (key_) fit({object});
}

bool AlignRos::onRerun(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  response.success = key_ != nullptr;
  response.message = key_ ? "" : "there is no segmentation of the key frame yet";
  if (key_) fitAll();
  for (const auto& [object, model] : aligned_) {
    if (model.trusted) continue;
    response.message += model.object + ": " + model.reason + "\n";
  }
  return true;
}

void AlignRos::fit(const std::vector<int>& objects) {
  reporter_.preparing("aligning");
  double ms = 0.0;
  for (const int object : objects) {
    aligned_[object] = fitObject(object);
    ms += 1e3 * aligned_[object].seconds;
    if (!aligned_[object].trusted) {
      reporter_.warn(key_->header.stamp,
                     aligned_[object].object + " is not trusted: " + aligned_[object].reason);
    }
  }
  publish();
  reporter_.timing(key_->header.stamp, ms);
  reporter_.ready("aligned " + std::to_string(aligned_.size()) + " objects");
}

calipso_msgs::AlignedModel AlignRos::fitObject(int object) {
  const SceneObject& description = scene_.objects[object];
  const Eigen::Isometry3d& rough = description.initial_world_from_object;
  try {
    const calipso_msgs::ObjectContour* contour = findContour(*key_, description.name);
    if (!contour) throw std::invalid_argument("the segmentation has no contour of it: add strokes");
    return toMsg(description,
                 align(models_[object], scene_.camera, rough, fromMsg(*contour).loops, options_));
  } catch (const std::exception& error) {
    return toMsg(description, unaligned(models_[object], rough, error.what()));
  }
}

void AlignRos::publish() {
  calipso_msgs::AlignedModels models;
  models.header = header();
  for (const auto& [object, model] : aligned_) models.models.push_back(model);
  models_publisher_.publish(models);
  if (markers_publisher_.getNumSubscribers() > 0) markers_publisher_.publish(markers());
}

std_msgs::Header AlignRos::header() const {
  std_msgs::Header header;
  header.stamp = key_->header.stamp;
  header.frame_id = topics::kWorldFrame;
  return header;
}

visualization_msgs::MarkerArray AlignRos::markers() const {
  visualization_msgs::MarkerArray markers;
  for (const auto& [object, model] : aligned_) markers.markers.push_back(toMarker(header(), model));
  return markers;
}

}  // namespace calipso::align

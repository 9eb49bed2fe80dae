#include "player.hpp"

#include <calipso_msgs/ClipInfo.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <filesystem>
#include <iomanip>
#include <set>
#include <stdexcept>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"
#include "calipso_scene/same_camera.hpp"
#include "calipso_scene/triangle_mesh.hpp"
#include "clip_checks.hpp"
#include "edit_files.hpp"
#include "wait.hpp"

namespace calipso::bag {
namespace {

constexpr unsigned kQueue = 1000;
constexpr double kShowEverySec = 2.0;

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

std::vector<std::string> common(const std::vector<std::string>& a,
                                const std::vector<std::string>& b) {
  std::vector<std::string> both;
  for (const std::string& name : a) {
    if (std::find(b.begin(), b.end(), name) != b.end()) both.push_back(name);
  }
  return both;
}

std::vector<PlayedFrame> scheduleOf(const BagClip& clip,
                                    const std::vector<calipso_msgs::Edit>& edits) {
  std::vector<std::int64_t> frames;
  for (const ros::Time& stamp : clip.stamps()) frames.push_back(nanoseconds(stamp));
  std::vector<TimeScale> scales;
  for (const calipso_msgs::Edit& edit : edits) {
    if (edit.kind != calipso_msgs::Edit::TIME_SCALE) continue;
    scales.push_back({nanoseconds(edit.header.stamp), edit.factor});
  }
  return playSchedule(frames, scales);
}

bool needsWind(const std::vector<calipso_msgs::Edit>& edits) {
  return std::any_of(edits.begin(), edits.end(), [](const calipso_msgs::Edit& edit) {
    return edit.kind == calipso_msgs::Edit::WIND && edit.mode == calipso_msgs::Edit::ESTIMATED;
  });
}

}  // namespace

Preparation::Roles Player::rolesOf(const std::vector<std::string>& nodes) {
  Preparation::Roles roles;
  if (nodes.empty()) return roles;
  roles.key_frame = common(roles.key_frame, nodes);
  roles.clip = common(roles.clip, nodes);
  roles.all = nodes;
  return roles;
}

Player::Player(ros::NodeHandle& nh, const Params& params)
    : params_(params),
      nh_(nh),
      scene_(loadScene(params.scene)),
      clip_(params.clip),
      path_(cameraPath(clip_, scene_, poseSourceFromString(params.poses))),
      edits_(readEdits(params.edits, scene_, clip_.stamps().front())),
      schedule_(scheduleOf(clip_, edits_)),
      watch_(nh, rolesOf(params.nodes)),
      window_(params.in_flight) {
  checkScene();
  checkEdits();
  warnOfCuts();
  advertiseAll();
  ROS_INFO_STREAM(params.clip.path << ": " << clip_.frameCount() << " frames of "
                                   << clip_.imageTopic() << ", " << clip_.firstInfo().width << "x"
                                   << clip_.firstInfo().height << ", " << edits_.size()
                                   << " edits; camera poses from " << path_.origin);
}

void Player::checkScene() const {
  const sensor_msgs::CameraInfo& info = clip_.firstInfo();
  try {
    checkSameCamera(scene_, fromMsg(info, fromMsg(path_.world_from_camera.front().transform)));
  } catch (const std::exception& error) {
    throw std::runtime_error(params_.clip.path + ": " + error.what());
  }
  constexpr int kDepthBits = 16, kMaskBits = 8;
  checkPicture(scene_.depth_path, kDepthBits, scene_.camera.width, scene_.camera.height);
  for (const std::string& mask : {scene_.strokes_path, scene_.matte_path})
    checkPicture(mask, kMaskBits, scene_.camera.width, scene_.camera.height);
  for (const std::string& support : scene_.support_meshes) loadMesh(support);
  std::set<int> indices;
  for (const SceneObject& object : scene_.objects) {
    checkModelSize(object, loadMesh(object.cad_path), scene_.camera);
    indices.insert(object.index);
  }
  checkStrokes(scene_.strokes_path, indices);
}

void Player::warnOfCuts() const {
  for (const int frame : clip_.shotChanges()) {
    const double time = (clip_.stamps()[frame] - clip_.stamps().front()).toSec();
    ROS_WARN_STREAM(params_.clip.path
                    << ": frame " << frame << " (" << time
                    << " s) shows something else than the one before: the scene is "
                       "that of the first shot alone; cut the bag there");
  }
}

void Player::checkEdits() const {
  const ros::Time first = clip_.stamps().front(), last = clip_.stamps().back();
  for (const calipso_msgs::Edit& edit : edits_) {
    if (edit.header.stamp < first) {
      throw std::runtime_error(
          params_.edits + ": edit '" + edit.kind + "' of '" + edit.object + "' is for " +
          std::to_string(edit.header.stamp.toSec()) + " s, before the first frame at " +
          std::to_string(first.toSec()) +
          " s; edits of a bag go with its own recording: write them as edits.yaml for another");
    }
    if (edit.kind == calipso_msgs::Edit::INSERT)
      loadMesh((std::filesystem::path(scene_.directory) / edit.model).string());
    if (edit.header.stamp <= last) continue;
    ROS_WARN_STREAM("edit '" << edit.kind << "' of '" << edit.object << "' lies "
                             << (edit.header.stamp - last).toSec()
                             << " s after the last frame and will not take effect");
  }
}

// A subscriber whose connection closes has most likely ended.
template <typename M>
ros::Publisher Player::advertise(const std::string& topic, bool latched) {
  ros::AdvertiseOptions options;
  options.init<M>(
      topic, kQueue,
      [this](const ros::SingleSubscriberPublisher& subscriber) {
        links_.opened(subscriber.getTopic(), subscriber.getSubscriberName());
      },
      [this](const ros::SingleSubscriberPublisher& subscriber) {
        links_.closed(subscriber.getTopic(), subscriber.getSubscriberName());
        watch_.connectionLost(subscriber.getSubscriberName());
      });
  options.latch = latched;
  advertised_.insert(nh_.resolveName(topic));
  return nh_.advertise(options);
}

void Player::advertiseAll() {
  constexpr bool kLatched = true, kOnce = false;
  clip_info_ = advertise<calipso_msgs::ClipInfo>(topics::kClipInfo, kLatched);
  clip_image_ = advertise<sensor_msgs::Image>(topics::kClipImage, kLatched);
  clip_camera_info_ = advertise<sensor_msgs::CameraInfo>(topics::kClipCameraInfo, kLatched);
  image_ = advertise<sensor_msgs::Image>(topics::kImage, kOnce);
  camera_info_ = advertise<sensor_msgs::CameraInfo>(topics::kCameraInfo, kOnce);
  tf_ = advertise<tf2_msgs::TFMessage>("/tf", kLatched);
  edit_ = advertise<calipso_msgs::Edit>(topics::kEdits, kOnce);
  edited_ = nh_.subscribe(topics::kImageEditedCameraInfo, kQueue, &Player::onEdited, this,
                          ros::TransportHints().tcpNoDelay());
}

void Player::run() {
  waitForGraph();
  watch_.repeatFailures();
  announceClip();
  prepare();
  sendEdits();
  playFrames();
  watch_.runIsOver();
}

// Nodes of the run that have not said anything yet; the recorder has to say that it is ready.
std::vector<std::string> Player::silent() const {
  std::vector<std::string> names;
  for (const std::string& node : watch_.preparation().unsettled()) {
    if (node == "recorder" || watch_.preparation().standing(node).message.empty())
      names.push_back(node);
  }
  return names;
}

// A node reports once it has subscribed, so by then the master knows what it is to be sent.
std::vector<std::string> Player::unconnected() const {
  std::vector<std::string> names =
      links_.missing(registeredSubscriptions(), advertised_, watch_.rosNames());
  if (edited_.getNumPublishers() == 0) names.push_back("a renderer to the player");
  return names;
}

// True once the renderer has failed before it could offer edited frames.
bool Player::undrawn() const {
  return watch_.preparation().standing("render").state == NodeState::kFailed &&
         edited_.getNumPublishers() == 0;
}

// A frame sent before everyone is connected would be lost to some.
void Player::waitForGraph() {
  const auto wait = [this](const auto& missing, const std::string& complaint,
                           const std::string& remedy) {
    const auto done = [&] { return undrawn() || missing().empty(); };
    const bool in_time = waitFor(done, params_.connect_timeout_sec);
    if (undrawn()) {
      throw std::runtime_error("nobody draws the frames, render has failed: " +
                               watch_.preparation().standing("render").message);
    }
    if (in_time) return;
    throw std::runtime_error("after " + std::to_string(params_.connect_timeout_sec) + " s " +
                             complaint + ": " + listed(missing()) + "; " + remedy);
  };
  wait([this] { return silent(); }, "these nodes have not reported",
       "look for their own messages above");
  wait([this] { return unconnected(); }, "not connected",
       "can the machines reach each other (ROS_IP, ROS_HOSTNAME)?");
}

void Player::announceClip() {
  tf2_msgs::TFMessage tf;
  for (const PlayedFrame& played : schedule_) {  // in slow motion a picture's camera rests, too
    tf.transforms.push_back(path_.world_from_camera[played.source]);
    tf.transforms.back().header.stamp.fromNSec(static_cast<std::uint64_t>(played.time_ns));
  }
  tf_.publish(tf);
  calipso_msgs::ClipInfo info;
  info.header.stamp = clip_.stamps().front();
  info.header.frame_id = clip_.frameId();
  info.frames = static_cast<std::uint32_t>(clip_.frameCount());
  info.fps = clip_.fps();
  info.last_stamp = clip_.stamps().back();
  info.played_frames = static_cast<std::uint32_t>(schedule_.size());
  info.wind_wanted = params_.estimate_wind || needsWind(edits_);
  clip_info_.publish(info);
}

void Player::prepare() {
  sendClipFrames();
  waitForProgress([this] { return watch_.preparation().allSettled(); }, "preparation");
  const std::vector<std::string> failed = watch_.preparation().failed();
  if (!failed.empty()) ROS_ERROR_STREAM("failed: " << listed(failed));
}

void Player::sendClipFrames() {
  const Preparation& nodes = watch_.preparation();
  BagClip::Reader reader = clip_.reader();
  for (int sent = 0; sent < clip_.frameCount() && !nodes.hopeless(); ++sent) {
    const auto has_room = [&] { return sent - nodes.clipFramesTaken(sent) < params_.in_flight; };
    waitForProgress([&] { return nodes.hopeless() || has_room(); }, "the clip");
    const BagFrame frame = reader.next();
    clip_image_.publish(frame.image);
    clip_camera_info_.publish(frame.info);
    if (sent == 0) waitForProgress([&] { return nodes.keyFrameSettled(); }, "the key frame");
  }
}

// Waits as long as anybody reports progress; nodes that stay silent are given up.
void Player::waitForProgress(const std::function<bool()>& done, const std::string& what) {
  while (!done()) {
    const int before = watch_.activity();
    const auto moved = [&] { return done() || watch_.activity() != before; };
    if (waitFor(moved, params_.prepare_timeout_sec)) continue;
    const std::vector<std::string> silent = watch_.preparation().unsettled();
    const std::string complaint = "no sign of life for " +
                                  std::to_string(params_.prepare_timeout_sec) + " s, waiting for " +
                                  what;
    if (silent.empty()) throw std::runtime_error(complaint + "; look for messages above");
    for (const std::string& node : silent) watch_.fail(node, complaint);
  }
}

// Edits and frames travel on different connections: no frame may overtake an edit.
void Player::sendEdits() {
  constexpr double kEditTimeoutSec = 10.0;
  for (const calipso_msgs::Edit& edit : edits_) edit_.publish(edit);
  const auto received = [this] {
    const NodeStanding simulator = watch_.preparation().standing("simulator");
    return watch_.preparation().hopeless() || simulator.state == NodeState::kFailed ||
           simulator.edits >= static_cast<int>(edits_.size());
  };
  if (!edits_.empty() && !waitFor(received, kEditTimeoutSec)) {
    throw std::runtime_error("the simulator has received " +
                             std::to_string(watch_.preparation().standing("simulator").edits) +
                             " of " + std::to_string(edits_.size()) +
                             " edits; does anything else publish or remap the topic of edits?");
  }
}

void Player::playFrames() {
  BagClip::Reader reader = clip_.reader();
  BagFrame frame;
  first_sent_ = last_shown_ = ros::WallTime::now();
  for (std::size_t i = 0; i < schedule_.size(); ++i) {
    if (i == 0 || schedule_[i].source != schedule_[i - 1].source) frame = reader.next();
    waitForEdited([this] { return window_.hasRoom() && recorded(window_.returned()); });
    playFrame(frame, ros::Time().fromNSec(static_cast<std::uint64_t>(schedule_[i].time_ns)));
  }
  while (!window_.empty())
    waitForEdited([this, before = window_.returned()] { return window_.returned() > before; });
}

void Player::playFrame(const BagFrame& frame, const ros::Time& stamp) {
  window_.sent(nanoseconds(stamp));
  if (stamp == frame.image->header.stamp) {
    camera_info_.publish(frame.info);
    image_.publish(frame.image);
    return;
  }
  const auto info = boost::make_shared<sensor_msgs::CameraInfo>(*frame.info);
  const auto image = boost::make_shared<sensor_msgs::Image>(*frame.image);
  info->header.stamp = image->header.stamp = stamp;
  camera_info_.publish(info);
  image_.publish(image);
}

// What the recorder has not taken in waits in memory.
bool Player::recorded(int edited) const {
  return edited - watch_.preparation().framesRecorded(edited) < params_.in_flight;
}

void Player::waitForEdited(const std::function<bool()>& done) {
  const bool in_time =
      waitFor([&] { return done() || watch_.ended("render"); }, params_.frame_timeout_sec);
  if (done()) return;
  if (!recorded(window_.returned())) {
    throw std::runtime_error(
        "the recorder has taken in " +
        std::to_string(watch_.preparation().framesRecorded(window_.returned())) + " of " +
        std::to_string(window_.returned()) + " edited frames, and none for " +
        std::to_string(params_.frame_timeout_sec) +
        " s; look for its messages above, and at its disk");
  }
  throw std::runtime_error(
      (in_time ? "the renderer's process ended"
               : "no edited frame for " + std::to_string(params_.frame_timeout_sec) + " s") +
      " after " + std::to_string(window_.returned()) + " of " + std::to_string(schedule_.size()) +
      " frames; look for the simulator's and the renderer's messages above");
}

void Player::onEdited(const sensor_msgs::CameraInfoConstPtr& info) {
  window_.cameBack(nanoseconds(info->header.stamp));
  showProgress();
}

void Player::showProgress() {
  const ros::WallTime now = ros::WallTime::now();
  const bool last = window_.returned() == static_cast<int>(schedule_.size());
  if (!last && (now - last_shown_).toSec() < kShowEverySec) return;
  last_shown_ = now;
  ROS_INFO_STREAM("edited " << window_.returned() << " of " << schedule_.size() << " frames, "
                            << std::fixed << std::setprecision(1)
                            << window_.returned() / (now - first_sent_).toSec() << " per second");
}

}  // namespace calipso::bag

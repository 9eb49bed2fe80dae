#include "render_ros.hpp"

#include <algorithm>
#include <chrono>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/same_message.hpp"
#include "calipso_ros/topics.hpp"
#include "calipso_scene/same_camera.hpp"
#include "conversions.hpp"

namespace calipso::render {
namespace {

constexpr std::size_t kLiveLabels = 300;  // label images kept in live mode
constexpr std::uint32_t kLatchedQueue = 10000;
// messages kept for a slow subscriber: in a clip nothing may be lost
constexpr std::uint32_t kKeepAll = 0, kLiveQueue = 10;
// Live images that wait while one is composed: the newest count.
constexpr std::uint32_t kLiveImages = 2;

double milliseconds(std::chrono::steady_clock::time_point since) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - since)
      .count();
}

}  // namespace

RenderNode::RenderNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : params_(loadParams(pnh)),
      reporter_(nh, "render"),
      poses_(params_.mode),
      clip_(params_.clip_samples),
      labels_(params_.mode == Mode::kLive ? kLiveLabels : 0) {
  const std::uint32_t queue = params_.mode == Mode::kLive ? kLiveQueue : kKeepAll;
  edited_ = nh.advertise<sensor_msgs::Image>(topics::kImageEdited, queue);
  edited_info_ = nh.advertise<sensor_msgs::CameraInfo>(topics::kImageEditedCameraInfo, queue);
  provenance_ = nh.advertise<sensor_msgs::Image>(topics::kProvenance, queue);
  plate_ = nh.advertise<sensor_msgs::Image>(topics::kPlate, 1, true);
  state_ = nh.subscribe(topics::kState, kLatchedQueue, &RenderNode::onState, this);
  subscribers_ = {
      nh.subscribe(topics::kClipInfo, 1, &RenderNode::onClipInfo, this),
      nh.subscribe(topics::kSegmentation, kLatchedQueue, &RenderNode::onSegmentation, this),
      nh.subscribe(topics::kModels, 1, &RenderNode::onModels, this),
      nh.subscribe(topics::kClipDynamics, 1, &RenderNode::onClipDynamics, this),
      nh.subscribe(topics::kStatus, 100, &RenderNode::onStatus, this),
  };
  clip_source_ = std::make_unique<FrameSource>(
      nh, topics::kClipImage, topics::kClipCameraInfo, 0, poses_,
      [this](const Frame& f) { onClipFrame(f); },
      [this](const sensor_msgs::ImageConstPtr& i, const std::string& r) { onBadClipFrame(i, r); });
  source_ = std::make_unique<FrameSource>(
      nh, topics::kImage, topics::kCameraInfo, params_.mode == Mode::kLive ? kLiveImages : kKeepAll,
      poses_, [this](const Frame& f) { onFrame(f); },
      [this](const sensor_msgs::ImageConstPtr& i, const std::string& r) { onBadFrame(i, r); });
  reporter_.starting("waiting for clip, segmentation and models");
}

void RenderNode::onClipInfo(const calipso_msgs::ClipInfoConstPtr& info) {
  clip_length_ = info->frames;
  prepareIfComplete();
}

void RenderNode::onClipFrame(const Frame& frame) {
  ++clip_frames_;
  if (reporter_.state() == calipso_msgs::NodeStatus::STARTING)
    reporter_.preparing("taking in the clip");
  unlabelled_.push_back(frame);
  pairClipFrames(ros::Time(0));
  reporter_.clipFrameDone();
  prepareIfComplete();
}

void RenderNode::onBadClipFrame(const sensor_msgs::ImageConstPtr& image,
                                const std::string& reason) {
  ++clip_frames_;
  reporter_.warn(image->header.stamp, "clip frame left out of the background: " + reason);
  reporter_.clipFrameDone();
  prepareIfComplete();
}

void RenderNode::onSegmentation(const calipso_msgs::SegmentationConstPtr& msg) {
  if (params_.mode == Mode::kLive && !clock_.covers(msg->header.stamp)) return;
  try {
    const cv::Mat labels = labelsFromMsg(msg->labels);
    labels_.put(msg->header.stamp, labels);
    // Of a frame that was segmented anew; its models follow.
    if (clip_.setLabels(nanoseconds(msg->header.stamp), labels)) moves_.reset();
  } catch (const std::exception& error) {
    reporter_.warn(msg->header.stamp, error.what());
    return;
  }
  pairClipFrames(msg->header.stamp);
  prepareIfComplete();
  if (params_.mode == Mode::kLive) workOff();
}

// Frames up to the newest segmentation either have theirs or will not get one.
void RenderNode::pairClipFrames(const ros::Time& segmented) {
  while (!unlabelled_.empty()) {
    const Frame frame = unlabelled_.front();
    const bool labelled = labels_.has(frame.stamp());
    if (!labelled && frame.stamp() >= segmented) return;
    unlabelled_.pop_front();
    if (labelled)
      addClipFrame(frame, labels_.at(frame.stamp()));
    else
      reporter_.warn(frame.stamp(),
                     "clip frame left out of the background: it has no segmentation");
  }
}

void RenderNode::addClipFrame(const Frame& frame, const cv::Mat& labels) {
  try {
    clip_.add({bgrFromMsg(*frame.image), labels, frame.camera, {}, nanoseconds(frame.stamp())});
  } catch (const std::exception& error) {
    reporter_.warn(frame.stamp(),
                   std::string("clip frame left out of the background: ") + error.what());
  }
}

// A latched message can come twice to a subscriber that connects while it is published.
void RenderNode::onModels(const calipso_msgs::AlignedModelsConstPtr& msg) {
  if (models_msg_ && sameMessage(*models_msg_, *msg)) return;
  models_msg_ = msg;
  try {
    models_ = fromMsg(*msg);
  } catch (const std::exception& error) {
    reporter_.failed(std::string("models cannot be used: ") + error.what());
    workOff();
    return;
  }
  renderer_.reset();
  unpreparable_ = false;
  moves_.reset();
  prepareIfComplete();
}

// The light and the sides that the key frame does not show are learnt once: what comes later is not
// used.
void RenderNode::onClipDynamics(const calipso_msgs::ClipDynamicsConstPtr& msg) {
  dynamics_ = msg;
  prepareIfComplete();
}

// Frames must not wait for a node that can do nothing.
void RenderNode::onStatus(const calipso_msgs::NodeStatusConstPtr& msg) {
  if (msg->node == "flow") {
    flow_works_ = msg->state != calipso_msgs::NodeStatus::FAILED;
    prepareIfComplete();
  }
  if (msg->node == "simulator") simulator_ready_ = msg->state == calipso_msgs::NodeStatus::READY;
  const bool needed =
      msg->node == "segmentation" || msg->node == "align" || msg->node == "simulator";
  if (!needed) return;
  failed_.erase(msg->node);
  if (msg->state == calipso_msgs::NodeStatus::FAILED) failed_[msg->node] = msg->message;
  const bool hopeless = failed_.count("segmentation") + failed_.count("align") > 0;
  if (hopeless && !renderer_) reporter_.failed(whyUnedited());
  workOff();
}

bool RenderNode::clipComplete() const {
  if (models_.empty() || clip_.frames().empty()) return false;
  if (params_.mode == Mode::kLive) return true;
  return clip_length_ && clip_frames_ >= *clip_length_ && unlabelled_.empty();
}

void RenderNode::prepareIfComplete() {
  if (!renderer_ && !unpreparable_ && clipComplete() && !mustWaitForPoses()) prepareNow();
}

// Where objects move, further frames show more of them; the poses that this takes come from the
// flow.
bool RenderNode::mustWaitForPoses() {
  if (params_.mode == Mode::kLive || dynamics_ || !flow_works_) return false;
  if (!moves_) moves_ = anyMoves(clip_, models_);
  if (!*moves_) return false;
  reporter_.preparing("waiting for the objects' motion in the clip");
  return true;
}

void RenderNode::prepareNow() {
  try {
    reporter_.preparing("background plate, light and appearance");
    const auto start = std::chrono::steady_clock::now();
    // Of a bag the player compares them.
    if (params_.mode == Mode::kLive) checkKeyFrame(clip_.frames().front());
    PosesTaken taken;
    if (dynamics_) taken = takePoses(posesFromMsg(*dynamics_, models_), models_, clip_);
    const auto prepared = std::make_shared<const Prepared>(prepare(clip_, models_, params_.render));
    renderer_ = std::make_unique<Renderer>(prepared, params_.render);
    cv::Mat plate;
    prepared->background.plate.convertTo(plate, CV_8U);
    std_msgs::Header header;
    header.frame_id = topics::kWorldFrame;
    plate_.publish(imageMsg(header, plate));
    for (const std::string& remark : prepared->remarks) reporter_.remark(remark);
    reporter_.ready("prepared from " + std::to_string(clip_.frames().size()) + " frames in " +
                    std::to_string(static_cast<int>(milliseconds(start))) +
                    " ms; frames used: " + std::to_string(prepared->light_views) +
                    " for the light, " + std::to_string(prepared->texture_views) +
                    " for textures, " + std::to_string(taken.accepted) + " of " +
                    std::to_string(taken.offered) + " poses fit their masks");
  } catch (const std::exception& error) {
    unpreparable_ = true;  // by these models: it is not tried again with every message
    reporter_.failed(error.what());
  }
  workOff();
}

void RenderNode::checkKeyFrame(const ClipFrame& first) {
  checkSameCamera(params_.scene, first.camera);
  const double late =
      1e-9 * static_cast<double>(first.stamp_ns) - models_msg_->header.stamp.toSec();
  if (late > 0.0)
    reporter_.remark("the key frame was missed: what is seen " + std::to_string(late) +
                     " s after it stands for it, which is wrong of what has moved since");
}

// What is known of frames that are not later stays: it is sent once only, perhaps before this.
void RenderNode::startOver(const ros::Time& stamp) {
  reporter_.remark(kStartsOver);
  renderer_.reset();
  clip_ = ClipSample(params_.clip_samples);
  labels_.forgetAfter(stamp);
  unlabelled_.clear();
  if (models_msg_ && models_msg_->header.stamp > stamp) {
    models_msg_.reset();
    models_.clear();
  }
  dynamics_.reset();
  moves_.reset();
  unpreparable_ = false;
  frames_.clear();
  states_.clear();
  left_ = ros::Time();
  reporter_.starting("waiting for segmentation and models");
}

void RenderNode::onFrame(const Frame& frame) {
  if (params_.mode == Mode::kLive && clock_.startsOver(frame.stamp())) startOver(frame.stamp());
  if (params_.mode == Mode::kLive && !renderer_) {
    unlabelled_.push_back(frame);
    // The first one most likely is the key frame, whose segmentation takes longest.
    if (unlabelled_.size() > static_cast<std::size_t>(params_.live_queue))
      unlabelled_.erase(unlabelled_.begin() + (clip_.frames().empty() ? 1 : 0));
    pairClipFrames(ros::Time(0));
    prepareIfComplete();
  }
  frames_.push_back({frame.image, frame.info, frame.camera, ""});
  workOff();
}

void RenderNode::onBadFrame(const sensor_msgs::ImageConstPtr& image, const std::string& reason) {
  frames_.push_back({image, nullptr, std::nullopt, reason});
  workOff();
}

void RenderNode::onState(const calipso_msgs::SimulationStateConstPtr& msg) {
  const bool gone = msg->header.stamp <= left_;  // the frame went without it
  if (params_.mode == Mode::kLive && (gone || !clock_.covers(msg->header.stamp))) return;
  states_[msg->header.stamp] = msg;
  if (params_.mode == Mode::kLive && renderer_) skipOlderThan(msg->header.stamp);
  workOff();
}

// Live: states come in order, so that what has none before this one gets none.
void RenderNode::skipOlderThan(const ros::Time& stamp) {
  const auto first_stamp = [&] { return frames_.front().image->header.stamp; };
  while (!frames_.empty() && first_stamp() < stamp && states_.count(first_stamp()) == 0) {
    countSkipped(first_stamp(), 1, "the simulator is too slow");
    left_ = first_stamp();
    frames_.pop_front();
  }
}

void RenderNode::countSkipped(const ros::Time& stamp, std::size_t frames, const std::string& why) {
  skipped_ += frames;
  reporter_.warn(stamp, "frame skipped, " + why + "; " + std::to_string(skipped_) + " so far");
}

// Empty: frames can be edited. Otherwise the reason why they pass unedited, "" while they must
// wait.
std::string RenderNode::whyUnedited() const {
  if (!failed_.empty()) return failed_.begin()->first + " failed: " + failed_.begin()->second;
  if (reporter_.state() == calipso_msgs::NodeStatus::FAILED)
    return "the renderer could not be prepared";
  if (params_.mode == Mode::kLive && !renderer_)
    return "not ready yet: waiting for segmentation and models";
  if (params_.mode == Mode::kLive && !simulator_ready_)
    return "not ready yet: waiting for the simulator";
  if (params_.mode == Mode::kLive && state_.getNumPublishers() == 0)
    return "the simulator has ended: start the launch again";
  return "";
}

void RenderNode::workOff() {
  while (!frames_.empty() && workOffFront()) {
  }
  if (params_.mode != Mode::kLive) return;
  while (frames_.size() > static_cast<std::size_t>(params_.live_queue)) {
    left_ = frames_.front().image->header.stamp;
    countSkipped(left_, 1, "no state came");
    frames_.pop_front();
  }
}

// false: the first frame has to wait.
bool RenderNode::workOffFront() {
  const Waiting frame = frames_.front();
  const ros::Time stamp = frame.image->header.stamp;
  const std::string reason = frame.camera ? whyUnedited() : frame.trouble;
  const auto state = states_.find(stamp);
  if (reason.empty() && (!renderer_ || state == states_.end() || mustWaitForMask(stamp)))
    return false;
  frames_.pop_front();
  if (reason.empty())
    edit(frame, *state->second);
  else
    passUnedited(frame, reason);
  const auto missed = std::distance(states_.begin(), states_.lower_bound(stamp));
  if (params_.mode == Mode::kLive && missed > 0)
    countSkipped(stamp, missed, "the machine is too slow");
  states_.erase(states_.begin(), states_.upper_bound(stamp));
  left_ = std::max(left_, stamp);
  return true;
}

// Live: its mask comes soon, or never if a later frame's has come; a segmentation that lags must not
// hold up the video.
bool RenderNode::mustWaitForMask(const ros::Time& stamp) const {
  return params_.mode == Mode::kLive && labels_.newest() < stamp &&
         frames_.size() < static_cast<std::size_t>(params_.live_queue);
}

void RenderNode::edit(const Waiting& frame, const calipso_msgs::SimulationState& state) {
  const auto start = std::chrono::steady_clock::now();
  const ros::Time stamp = frame.image->header.stamp;
  try {
    FrameInput input;
    for (const calipso_msgs::ObjectState& o : state.objects) input.objects.push_back(fromMsg(o));
    input.sun = sunFromMsg(state);
    const bool touched = std::any_of(input.objects.begin(), input.objects.end(),
                                     [](const ObjectInFrame& o) { return o.edited || o.removed; });
    if (!touched) {
      publish(frame, *frame.image, cv::Mat::zeros(frame.image->height, frame.image->width, CV_8U));
    } else {
      input.bgr = bgrFromMsg(*frame.image);
      input.labels = labels_.at(stamp);
      input.camera = *frame.camera;
      input.stamp_ns = nanoseconds(params_.mode == Mode::kLive ? stamp : labels_.stampAt(stamp));
      const FrameOutput output = renderer_->composite(input);
      publish(frame, editedMsg(*frame.image, output), output.provenance);
    }
    reporter_.timing(stamp, milliseconds(start));
  } catch (const std::exception& error) {
    passUnedited(frame, error.what());
  }
}

void RenderNode::passUnedited(const Waiting& frame, const std::string& reason) {
  reporter_.warn(frame.image->header.stamp, "frame passes unedited: " + reason);
  publish(frame, *frame.image, cv::Mat::zeros(frame.image->height, frame.image->width, CV_8U));
}

void RenderNode::publish(const Waiting& frame, const sensor_msgs::Image& edited,
                         const cv::Mat& provenance) {
  provenance_.publish(imageMsg(frame.image->header, provenance));
  if (frame.info) edited_info_.publish(*frame.info);
  edited_.publish(edited);
}

}  // namespace calipso::render

#include "flow_ros.hpp"

#include <algorithm>
#include <chrono>
#include <limits>

#include "calipso_ros/same_message.hpp"
#include "calipso_ros/topics.hpp"
#include "conversions.hpp"

namespace calipso::flow {
namespace {

constexpr unsigned kKeepAll = 0;
constexpr unsigned kLiveQueue = 10;
constexpr double kDescribeEvery = 1.0;  // s, at least: how deforming objects have moved of late
// of one core: what may be spent on that, whose search for the wind costs most
constexpr double kDescribeShare = 0.2;
constexpr size_t kLiveWaiting = 60;  // frames kept until it is known which one is the key frame

double millisecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

}  // namespace

FlowNode::FlowNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : params_(loadParams(pnh)),
      scene_(loadScene(params_.scene)),
      poses_(params_.mode),
      reporter_(nh, "flow"),
      clip_dynamics_publisher_(
          nh.advertise<calipso_msgs::ClipDynamics>(topics::kClipDynamics, 1, true)),
      dynamics_publisher_(nh.advertise<calipso_msgs::Dynamics>(topics::kDynamics, kKeepAll)),
      flow_publisher_(nh.advertise<sensor_msgs::Image>(
          topics::kFlow, params_.mode == Mode::kLive ? kLiveQueue : kKeepAll)),
      markers_(nh),
      dense_flow_(params_.flow_preset) {
  params_.dynamics.supports = scene_.onlySupports();
  subscribers_ = {nh.subscribe(topics::kModels, 1, &FlowNode::onModels, this),
                  nh.subscribe(topics::kSegmentation, kKeepAll, &FlowNode::onSegmentation, this),
                  nh.subscribe(topics::kStatus, 100, &FlowNode::onStatus, this)};
  if (params_.mode == Mode::kBag) {
    subscribers_.push_back(nh.subscribe(topics::kClipInfo, 1, &FlowNode::onClipInfo, this));
    clip_frames_source_ = std::make_unique<FrameSource>(
        nh, topics::kClipImage, topics::kClipCameraInfo, kKeepAll, poses_,
        [this](const calipso::Frame& frame) { onClipFrame(frame); },
        [this](const auto& image, const auto& reason) { onBadFrame(image, reason, true); });
  }
  frames_source_ = std::make_unique<FrameSource>(
      nh, topics::kImage, topics::kCameraInfo, params_.mode == Mode::kLive ? 2 : kKeepAll, poses_,
      [this](const calipso::Frame& frame) { onFrame(frame); },
      [this](const auto& image, const auto& reason) { onBadFrame(image, reason, false); });
  reporter_.starting("waiting for the key frame's models");
}

void FlowNode::onClipInfo(const calipso_msgs::ClipInfoConstPtr& info) {
  clip_ = info;
  finishWhenComplete();
}

void FlowNode::onModels(const calipso_msgs::AlignedModelsConstPtr& models) {
  const bool corrected = key_.models() && !sameMessage(*key_.models(), *models);
  key_.take(models);
  if (corrected && live_analyser_) {
    reporter_.remark("the models have been corrected: motion is followed anew");
    stopFollowing();
  } else if (corrected && clip_analyser_) {
    reporter_.remark(
        "the models have been corrected: the clip's motion is still that of the models before; "
        "start anew for another");
  }
  beginWhenPossible();
}

void FlowNode::onSegmentation(const calipso_msgs::SegmentationConstPtr& segmentation) {
  key_.take(segmentation);
  beginWhenPossible();
  beginLate(*segmentation);
}

void FlowNode::onStatus(const calipso_msgs::NodeStatusConstPtr& status) {
  const bool needed = status->node == "align" || status->node == "segmentation";
  if (!needed || status->state != calipso_msgs::NodeStatus::FAILED) return;
  if (clip_analyser_ || live_analyser_) return;
  reporter_.failed("no dynamics without models: " + status->node + " failed (" + status->message +
                   ")");
}

void FlowNode::onClipFrame(const calipso::Frame& frame) {
  ++clip_frames_;
  if (clip_analyser_) {
    analyse(frame);
  } else {
    waiting_.push_back(frame);
    reporter_.preparing("waiting for the key frame's models");
    beginWhenPossible();
  }
  reporter_.clipFrameDone();
  finishWhenComplete();
}

void FlowNode::onBadFrame(const sensor_msgs::ImageConstPtr& image, const std::string& reason,
                          bool of_clip) {
  reporter_.warn(image->header.stamp, reason);
  if (!of_clip) return;
  ++clip_frames_;
  reporter_.clipFrameDone();
  finishWhenComplete();
}

// Starts once the models, their masks and the key frame are there.
void FlowNode::beginWhenPossible() {
  if (clip_analyser_ || live_analyser_) return;
  try {
    const std::optional<KeyKnowledge> knowledge = key_.knowledge(scene_);
    if (knowledge) begin(*knowledge);
  } catch (const std::exception& error) {
    reporter_.failed(error.what());
  }
}

void FlowNode::begin(const KeyKnowledge& knowledge) {
  const auto key = std::find_if(waiting_.begin(), waiting_.end(), [&](const calipso::Frame& f) {
    return f.stamp() == *key_.keyStamp();
  });
  if (key == waiting_.end()) return;
  const Frame key_frame = frameFromMsg(*key);
  if (params_.mode == Mode::kLive) return follow(key_frame, knowledge);
  clip_analyser_ = std::make_unique<ClipAnalyser>(key_frame, knowledge.models, knowledge.masks,
                                                  scene_.gravity, params_.dynamics);
  headers_ = {key->image->header};
  const std::vector<calipso::Frame> later(key + 1, waiting_.end());
  waiting_.clear();
  for (const calipso::Frame& frame : later) analyse(frame);
  finishWhenComplete();
}

void FlowNode::follow(const Frame& first, const KeyKnowledge& knowledge) {
  live_analyser_ = std::make_unique<LiveAnalyser>(first, knowledge.models, knowledge.masks,
                                                  scene_.gravity, params_.dynamics);
  waiting_.clear();
  reporter_.ready("following " + std::to_string(knowledge.models.size()) + " objects");
}

// A camera that ran before this node did, or models corrected since: the key frame is gone. What has
// not moved since is where its model is in later frames, too.
void FlowNode::beginLate(const calipso_msgs::Segmentation& segmentation) {
  if (params_.mode != Mode::kLive || live_analyser_ || !key_.keyStamp()) return;
  const auto of = [](const ros::Time& stamp) {
    return [stamp](const calipso::Frame& f) { return f.stamp() == stamp; };
  };
  const auto frame = std::find_if(waiting_.begin(), waiting_.end(), of(segmentation.header.stamp));
  const bool missed = std::none_of(waiting_.begin(), waiting_.end(), of(*key_.keyStamp())) &&
                      segmentation.header.stamp > *key_.keyStamp();
  if (!missed || frame == waiting_.end()) return;
  try {
    if (!key_.knowledge(scene_)) return;
    const KeyKnowledge knowledge = key_.knowledgeAt(segmentation, scene_);
    reporter_.remark("the key frame is gone: motion is followed from " +
                     std::to_string((frame->stamp() - *key_.keyStamp()).toSec()) + " s after it");
    follow(frameFromMsg(*frame), knowledge);
  } catch (const std::exception& error) {
    reporter_.failed(error.what());
  }
}

// Of live frames the key frame is needed, whichever that will be; of those that missed it the newest.
void FlowNode::keepWaiting(const calipso::Frame& frame) {
  const std::optional<ros::Time> key = key_.segmentedStamp();
  const auto is_key = [&](const calipso::Frame& f) { return key && f.stamp() == *key; };
  if (std::any_of(waiting_.begin(), waiting_.end(), is_key)) {
    waiting_.erase(std::remove_if(waiting_.begin(), waiting_.end(),
                                  [&](const calipso::Frame& f) { return !is_key(f); }),
                   waiting_.end());
    return;
  }
  // The first one most likely is the key frame, which is not known before it has been segmented.
  if (waiting_.size() >= kLiveWaiting) waiting_.erase(waiting_.begin() + (key ? 0 : 1));
  waiting_.push_back(frame);
}

void FlowNode::analyse(const calipso::Frame& frame) {
  const auto start = std::chrono::steady_clock::now();
  try {
    clip_analyser_->add(frameFromMsg(frame));
    headers_.push_back(frame.image->header);
  } catch (const std::exception& error) {
    reporter_.warn(frame.stamp(), error.what());
  }
  reporter_.timing(frame.stamp(), millisecondsSince(start));
}

void FlowNode::finishWhenComplete() {
  if (finished_ || !clip_ || !clip_analyser_ || clip_frames_ < clip_->frames) return;
  finished_ = true;
  try {
    std::vector<ObjectDynamics> objects = clip_analyser_->finish(clip_->wind_wanted);
    const calipso_msgs::ClipDynamics msg =
        clipDynamicsMsg(scene_, objects, clip_analyser_->cutTimes(), headers_);
    for (const auto& frame : msg.frames) dynamics_[frame.header.stamp] = frame;
    clip_dynamics_publisher_.publish(msg);
    reporter_.ready(summary(objects));
    markers_.keep(std::move(objects));
  } catch (const std::exception& error) {
    reporter_.failed(error.what());
  }
}

// What is known of a key frame that is not later stays: it is sent once only, perhaps before this.
void FlowNode::startOver(const ros::Time& stamp) {
  reporter_.remark(kStartsOver);
  stopFollowing();
  key_.forgetAfter(stamp);
  previous_image_.reset();
}

void FlowNode::stopFollowing() {
  describing_ = {};  // waits for its end
  live_analyser_.reset();
  waiting_.clear();
  of_late_.clear();
  modes_told_ = 0;
  described_ = ros::Time();
  describe_every_ = 0.0;
  reporter_.starting("waiting for the key frame's models");
}

void FlowNode::onFrame(const calipso::Frame& frame) {
  if (params_.mode == Mode::kLive && clock_.startsOver(frame.stamp())) startOver(frame.stamp());
  const auto start = std::chrono::steady_clock::now();
  try {
    publishDynamics(frame);
    publishFlow(frame);
  } catch (const std::exception& error) {
    reporter_.warn(frame.stamp(), error.what());
  }
  reporter_.timing(frame.stamp(), millisecondsSince(start));
}

void FlowNode::publishDynamics(const calipso::Frame& frame) {
  if (params_.mode == Mode::kLive) {
    if (!live_analyser_) {
      keepWaiting(frame);
      beginWhenPossible();
      return;
    }
    const auto motions = live_analyser_->add(frameFromMsg(frame));
    tellNewModes(frame.image->header);
    describeOfLate(frame.image->header);
    auto msg = dynamicsMsg(scene_, motions, frame.image->header);
    addWinds(of_late_, frame.stamp().toSec(), msg);
    dynamics_publisher_.publish(msg);
    return;
  }
  const auto known = dynamics_.find(frame.stamp());
  if (known == dynamics_.end()) {
    dynamics_publisher_.publish(dynamicsMsg(scene_, {}, frame.image->header));
    return;
  }
  dynamics_publisher_.publish(known->second);
  markers_.publish(std::distance(dynamics_.begin(), known), frame.stamp());
}

// Without the modes nobody can make anything of their amplitudes.
void FlowNode::tellNewModes(const std_msgs::Header& header) {
  const size_t count = live_analyser_->deforming().size();
  if (count == modes_told_) return;
  modes_told_ = count;
  clip_dynamics_publisher_.publish(liveDynamicsMsg(of_late_, *live_analyser_, header));
}

// Beside the frames, which must not wait for it.
void FlowNode::describeOfLate(const std_msgs::Header& header) {
  if (describing_.valid()) {
    if (describing_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
    Description description = describing_.get();
    of_late_ = std::move(description.objects);
    describe_every_ = std::max(kDescribeEvery, description.seconds / kDescribeShare);
    clip_dynamics_publisher_.publish(liveDynamicsMsg(of_late_, *live_analyser_, header));
    reporter_.ready(summary(of_late_));
  }
  if ((header.stamp - described_).toSec() < describe_every_) return;
  std::vector<DeformationWindow> windows = live_analyser_->windows();
  if (windows.empty()) return;
  described_ = header.stamp;
  describing_ = std::async(std::launch::async, [this, windows = std::move(windows)] {
    const auto start = std::chrono::steady_clock::now();
    std::vector<ObjectDynamics> objects = describe(windows, scene_.gravity, true);
    return Description{std::move(objects), 1e-3 * millisecondsSince(start)};
  });
}

// The flow lives on this frame's pixels: how far each has come since the frame before.
void FlowNode::publishFlow(const calipso::Frame& frame) {
  const sensor_msgs::ImageConstPtr before = previous_image_;
  previous_image_ = frame.image;
  if (flow_publisher_.getNumSubscribers() == 0) return;
  const cv::Mat now = pictureFromMsg(frame.image);
  cv::Mat flow(now.size(), CV_32FC2, cv::Scalar::all(std::numeric_limits<float>::quiet_NaN()));
  if (before) flow = -dense_flow_.compute(now, pictureFromMsg(before));
  flow_publisher_.publish(flowToMsg(flow, frame.image->header));
}

}  // namespace calipso::flow

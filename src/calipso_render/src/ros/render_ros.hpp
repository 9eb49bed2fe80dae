#pragma once

#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/ClipDynamics.h>
#include <calipso_msgs/ClipInfo.h>
#include <calipso_msgs/NodeStatus.h>
#include <calipso_msgs/Segmentation.h>
#include <calipso_msgs/SimulationState.h>
#include <ros/ros.h>

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "calipso_render/renderer.hpp"
#include "calipso_ros/frame_source.hpp"
#include "calipso_ros/node_reporter.hpp"
#include "calipso_ros/video_clock.hpp"
#include "label_store.hpp"
#include "params.hpp"

namespace calipso::render {

// Wires the renderer to topics. Preparation: clip frames, their segmentation and the models.
// Editing: every image leaves once, in order, composed with the state of its stamp. All callbacks
// run in one thread, which is what protects everything below.
class RenderNode {
 public:
  RenderNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  // A frame to edit. Without a camera it can only pass unedited; `trouble` says why.
  struct Waiting {
    sensor_msgs::ImageConstPtr image;
    sensor_msgs::CameraInfoConstPtr info;
    std::optional<Camera> camera;
    std::string trouble;
  };

  void onClipInfo(const calipso_msgs::ClipInfoConstPtr& info);
  void onClipFrame(const Frame& frame);
  void onBadClipFrame(const sensor_msgs::ImageConstPtr& image, const std::string& reason);
  void onSegmentation(const calipso_msgs::SegmentationConstPtr& msg);
  void onModels(const calipso_msgs::AlignedModelsConstPtr& msg);
  void onClipDynamics(const calipso_msgs::ClipDynamicsConstPtr& msg);
  void onStatus(const calipso_msgs::NodeStatusConstPtr& msg);
  void onFrame(const Frame& frame);
  void onBadFrame(const sensor_msgs::ImageConstPtr& image, const std::string& reason);
  void onState(const calipso_msgs::SimulationStateConstPtr& msg);

  void startOver(const ros::Time& stamp);
  void addClipFrame(const Frame& frame, const cv::Mat& labels);
  void pairClipFrames(const ros::Time& segmented);
  bool clipComplete() const;
  bool mustWaitForPoses();
  void prepareIfComplete();
  void prepareNow();
  // @throw std::invalid_argument if another camera took it
  void checkKeyFrame(const ClipFrame& first);
  void workOff();
  bool workOffFront();
  bool mustWaitForMask(const ros::Time& stamp) const;
  void skipOlderThan(const ros::Time& stamp);
  void countSkipped(const ros::Time& stamp, std::size_t frames, const std::string& why);
  void edit(const Waiting& frame, const calipso_msgs::SimulationState& state);
  void passUnedited(const Waiting& frame, const std::string& reason);
  void publish(const Waiting& frame, const sensor_msgs::Image& edited, const cv::Mat& provenance);
  std::string whyUnedited() const;

  NodeParams params_;
  NodeReporter reporter_;
  CameraPoses poses_;
  ros::Publisher edited_, edited_info_, provenance_, plate_;

  VideoClock clock_;  // live
  ClipSample clip_;
  LabelStore labels_;
  std::deque<Frame> unlabelled_;  // clip frames that wait for their segmentation
  std::optional<std::uint32_t> clip_length_;
  std::uint32_t clip_frames_ = 0;  // seen, good or bad
  calipso_msgs::AlignedModelsConstPtr models_msg_;
  std::vector<ObjectModel> models_;
  // of the clip; empty: not there yet, or nobody estimates it
  calipso_msgs::ClipDynamicsConstPtr dynamics_;
  bool flow_works_ = false;                    // somebody estimates it, and has not failed
  bool simulator_ready_ = false;               // live: a state comes for every frame
  std::map<std::string, std::string> failed_;  // node -> why
  std::optional<bool> moves_;                  // anything in the clip; empty: not looked at yet
  bool unpreparable_ = false;
  std::unique_ptr<Renderer> renderer_;

  std::deque<Waiting> frames_;
  std::map<ros::Time, calipso_msgs::SimulationStateConstPtr> states_;
  ros::Time left_;             // of the newest frame that has left, however
  std::uint64_t skipped_ = 0;  // live mode: frames that were left out

  std::unique_ptr<FrameSource> clip_source_, source_;
  ros::Subscriber state_;
  std::vector<ros::Subscriber> subscribers_;
};

}  // namespace calipso::render

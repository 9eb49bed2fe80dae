#pragma once

#include <calipso_msgs/NodeStatus.h>
#include <ros/ros.h>

#include <future>
#include <map>
#include <memory>
#include <vector>

#include "calipso_flow/dense_flow.hpp"
#include "calipso_ros/frame_source.hpp"
#include "calipso_ros/node_reporter.hpp"
#include "calipso_ros/video_clock.hpp"
#include "clip_preparation.hpp"
#include "marker_publisher.hpp"
#include "params.hpp"

namespace calipso::flow {

// Wires the analysers to topics. Everything runs in the node's one callback thread.
//   bag:  clip frames + models + masks -> clip/dynamics; then, per image, dynamics and flow
//   live: image + models + masks -> per image, dynamics and flow; clip/dynamics of late
class FlowNode {
 public:
  FlowNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  void onClipInfo(const calipso_msgs::ClipInfoConstPtr& info);
  void onModels(const calipso_msgs::AlignedModelsConstPtr& models);
  void onSegmentation(const calipso_msgs::SegmentationConstPtr& segmentation);
  void onStatus(const calipso_msgs::NodeStatusConstPtr& status);
  void onClipFrame(const calipso::Frame& frame);
  void onFrame(const calipso::Frame& frame);
  void onBadFrame(const sensor_msgs::ImageConstPtr& image, const std::string& reason, bool of_clip);

  void startOver(const ros::Time& stamp);
  void stopFollowing();
  void beginWhenPossible();
  void begin(const KeyKnowledge& knowledge);
  void beginLate(const calipso_msgs::Segmentation& segmentation);
  void follow(const Frame& first, const KeyKnowledge& knowledge);
  void keepWaiting(const calipso::Frame& frame);
  void analyse(const calipso::Frame& frame);
  void finishWhenComplete();
  void publishDynamics(const calipso::Frame& frame);
  void tellNewModes(const std_msgs::Header& header);
  void describeOfLate(const std_msgs::Header& header);
  void publishFlow(const calipso::Frame& frame);

  Params params_;
  Scene scene_;
  CameraPoses poses_;
  NodeReporter reporter_;
  ros::Publisher clip_dynamics_publisher_, dynamics_publisher_, flow_publisher_;
  MarkerPublisher markers_;

  VideoClock clock_;  // live
  calipso_msgs::ClipInfoConstPtr clip_;
  KeyCollector key_;
  std::vector<calipso::Frame> waiting_;    // frames that came before the models
  std::vector<std_msgs::Header> headers_;  // of the frames the analyser has taken in
  unsigned clip_frames_ = 0;               // received, usable or not
  std::unique_ptr<ClipAnalyser> clip_analyser_;
  std::unique_ptr<LiveAnalyser> live_analyser_;
  std::map<ros::Time, calipso_msgs::Dynamics> dynamics_;
  bool finished_ = false;
  // Live: what the last seconds tell of deforming objects, and the work on the next such
  // description, which must end before the analyser does.
  struct Description {
    std::vector<ObjectDynamics> objects;
    double seconds;  // that it took
  };
  size_t modes_told_ = 0;  // of so many objects
  std::vector<ObjectDynamics> of_late_;
  ros::Time described_;
  double describe_every_ = 0.0;  // s
  std::future<Description> describing_;

  DenseFlow dense_flow_;
  sensor_msgs::ImageConstPtr previous_image_;

  // Last, so that no callback comes before the rest is there.
  std::vector<ros::Subscriber> subscribers_;
  std::unique_ptr<FrameSource> clip_frames_source_, frames_source_;
};

}  // namespace calipso::flow

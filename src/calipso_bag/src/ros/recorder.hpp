#pragma once

#include <calipso_msgs/ClipInfo.h>
#include <calipso_msgs/Edit.h>
#include <calipso_msgs/Segmentation.h>
#include <calipso_msgs/SimulationState.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_msgs/TFMessage.h>
#include <visualization_msgs/MarkerArray.h>

#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "calipso_bag/run_summary.hpp"
#include "calipso_ros/mode.hpp"
#include "calipso_ros/node_reporter.hpp"
#include "calipso_ros/video_clock.hpp"
#include "output_bag.hpp"
#include "stamped_writer.hpp"

namespace calipso::bag {

// Writes the edited bag: images, camera_info and everything that explains them, each message at its
// own stamp and in an order that does not depend on timing. The bag gets its name only when every
// frame that went in has come out; until then, and when a run ends early, it is PATH.active.
// Not thread-safe.
class Recorder {
 public:
  struct Params {
    std::string output;               // path of the bag
    std::vector<std::string> inputs;  // paths of what is read, which must stay
    Mode mode = Mode::kBag;           // live: record until stopped, instead of one clip
    bool flow = true;                 // also record the optical flow (8 bytes per pixel and frame)
    double late_timeout_sec = 5.0;    // for what explains the last frames to arrive
  };

  Recorder(ros::NodeHandle& nh, const Params& params);

  // Records the clip (or until ROS shuts down, live) and completes the bag.
  // @throw std::runtime_error when frames are missing, doubled or out of order
  void run();

  const RunSummary& summary() const { return summary_; }

 private:
  template <typename M>
  using Rank = std::function<std::string(const M&)>;

  // Records a topic whose messages have a header.
  template <typename M>
  void record(const std::string& topic, Rank<M> rank = nullptr);
  // Records a topic and tells the summary.
  template <typename M>
  void recordAndNote(const std::string& topic);
  template <typename M>
  void write(const std::string& topic, const ros::MessageEvent<M const>& event,
             const std::string& rank);

  void subscribeFrames();
  // @throw std::runtime_error when images are lost that were sent
  void waitForEdited();
  void subscribeExplanations();
  void onInput(const sensor_msgs::CameraInfoConstPtr& info);
  void onEdited(const ros::MessageEvent<sensor_msgs::Image const>& event);
  void onSegmentation(const ros::MessageEvent<calipso_msgs::Segmentation const>& event);
  void onState(const ros::MessageEvent<calipso_msgs::SimulationState const>& event);
  void onMarkers(const ros::MessageEvent<visualization_msgs::MarkerArray const>& event);
  void onTf(const ros::MessageEvent<tf2_msgs::TFMessage const>& event);
  bool connected() const;
  bool allEdited() const;
  bool allExplained() const;
  bool lastStateExplained() const;
  void recordClip();
  std::string keepIncomplete();
  void recordLive();
  void checkFrames() const;
  std::string nextRank();

  Params params_;
  ros::NodeHandle nh_;
  OutputBag output_;
  StampedWriter writer_;
  NodeReporter reporter_;
  RunSummary summary_;
  std::vector<ros::Subscriber> subscribers_;
  calipso_msgs::ClipInfo clip_;                  // frames == 0 until the player has announced it
  std::vector<ros::Time> input_, edited_;        // stamps, in the order they came
  std::map<std::string, int> count_;             // messages recorded, by topic
  calipso_msgs::SimulationStateConstPtr state_;  // the newest one, and its sender's ROS name
  std::string simulator_;
  std::map<std::string, ros::Time> newest_;  // plan by topic, markers by sender, tf by child frame
  int rank_ = 0;
  ros::WallTime first_edited_;
  // Live: a bag holds the video up to where its stamps go back.
  VideoClock clock_;
  bool started_over_ = false;
};

}  // namespace calipso::bag

#pragma once

#include <calipso_msgs/Edit.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "bag_clip.hpp"
#include "calipso_bag/flight_window.hpp"
#include "calipso_bag/play_schedule.hpp"
#include "calipso_scene/scene.hpp"
#include "camera_path.hpp"
#include "links.hpp"
#include "node_watch.hpp"

namespace calipso::bag {

// Plays a bag twice, in lock-step with the graph (docs/ARCHITECTURE.md, "Two passes"): once for the
// nodes to prepare on, once to be edited. Never more than a few frames are under way, so nothing is
// dropped and the result does not depend on the machine's speed. Not thread-safe.
class Player {
 public:
  struct Params {
    BagClip::Params clip;
    std::string scene;                   // folder
    std::string edits;                   // YAML file, edited bag, or none
    std::string poses = "auto";          // where the camera's poses come from: auto, bag, scene
    std::vector<std::string> nodes;      // the ones to wait for; empty: the whole graph
    bool estimate_wind = false;          // also when none of the edits needs it
    int in_flight = 4;                   // frames under way, >= 1
    double connect_timeout_sec = 60.0;   // for every node to report
    double prepare_timeout_sec = 600.0;  // without any progress of the preparation
    double frame_timeout_sec = 120.0;    // for one edited frame to come back
  };

  // Reads and checks everything there is to read.
  // @throw std::runtime_error / std::invalid_argument saying what is wrong and what to do
  Player(ros::NodeHandle& nh, const Params& params);

  // Plays both passes. @throw std::runtime_error when frames are lost or nobody answers
  void run();

 private:
  static Preparation::Roles rolesOf(const std::vector<std::string>& nodes);
  void checkScene() const;
  void warnOfCuts() const;
  void checkEdits() const;  // models to insert can be read; what comes too late is said
  template <typename M>
  ros::Publisher advertise(const std::string& topic, bool latched);
  void advertiseAll();
  std::vector<std::string> silent() const;
  std::vector<std::string> unconnected() const;
  bool undrawn() const;
  void waitForGraph();
  void announceClip();
  void prepare();
  void sendClipFrames();
  void waitForProgress(const std::function<bool()>& done, const std::string& what);
  void sendEdits();
  void playFrames();
  void playFrame(const BagFrame& frame, const ros::Time& stamp);
  bool recorded(int edited) const;
  void waitForEdited(const std::function<bool()>& done);
  void onEdited(const sensor_msgs::CameraInfoConstPtr& info);
  void showProgress();

  Params params_;
  ros::NodeHandle nh_;
  Scene scene_;
  BagClip clip_;
  CameraPath path_;
  std::vector<calipso_msgs::Edit> edits_;
  std::vector<PlayedFrame> schedule_;  // of the editing pass
  NodeWatch watch_;
  Links links_;
  std::set<std::string> advertised_;  // full names of the topics
  FlightWindow window_;
  ros::Publisher clip_info_, clip_image_, clip_camera_info_, image_, camera_info_, tf_, edit_;
  ros::Subscriber edited_;
  ros::WallTime first_sent_, last_shown_;
};

}  // namespace calipso::bag

#pragma once

#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/ClipInfo.h>
#include <calipso_msgs/Segmentation.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <visualization_msgs/MarkerArray.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "calipso_align/alignment.hpp"
#include "calipso_ros/mode.hpp"
#include "calipso_ros/node_reporter.hpp"
#include "calipso_scene/scene.hpp"
#include "ros/pose_markers.hpp"

namespace calipso::align {

struct AlignNodeParams {
  std::string scene;        // directory with scene.yaml
  std::vector<int> levels;  // about how many nodes the grids have, coarse to fine
  Mode mode = Mode::kBag;
  bool use_depth = true;  // the scene's depth image, where it has one; of a bag only
};

// @throw std::invalid_argument naming parameter, value and what is allowed
AlignNodeParams loadAlignParams(const ros::NodeHandle& pnh);

// Wires align() to topics: fits every object of the scene to the key frame's contours, again
// whenever these or a rough pose change. All callbacks run in the one spinning thread.
class AlignRos {
 public:
  AlignRos(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  void onClipInfo(const calipso_msgs::ClipInfoConstPtr& msg);
  void onSegmentation(const calipso_msgs::SegmentationConstPtr& msg);
  void onInitialPose(const geometry_msgs::PoseStampedConstPtr& msg, int object);
  void moveTo(int object, const Eigen::Isometry3d& world_from_object);
  bool onRerun(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);

  void fitAll();
  void fit(const std::vector<int>& objects);  // indices into scene_.objects
  calipso_msgs::AlignedModel fitObject(int object);
  void publish();
  std_msgs::Header header() const;  // of what is known of the key frame
  visualization_msgs::MarkerArray markers() const;

  AlignNodeParams params_;
  Scene scene_;
  std::vector<TriangleMesh> models_;  // like scene_.objects
  AlignOptions options_;
  NodeReporter reporter_;
  ros::Publisher models_publisher_, markers_publisher_;
  ros::Subscriber clip_subscriber_, segmentation_subscriber_;
  std::vector<ros::Subscriber> pose_subscribers_;
  ros::ServiceServer rerun_service_;
  std::unique_ptr<PoseMarkers> pose_markers_;
  calipso_msgs::SegmentationConstPtr key_;             // null before the first one with contours
  std::map<int, calipso_msgs::AlignedModel> aligned_;  // by index into scene_.objects
};

}  // namespace calipso::align

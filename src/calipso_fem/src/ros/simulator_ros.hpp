#pragma once

#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/ClipDynamics.h>
#include <calipso_msgs/ClipInfo.h>
#include <calipso_msgs/Dynamics.h>
#include <calipso_msgs/Edit.h>
#include <calipso_msgs/EditReport.h>
#include <calipso_msgs/NodeStatus.h>
#include <calipso_msgs/SimulationState.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <tf2_ros/transform_broadcaster.h>

#include <memory>
#include <optional>
#include <vector>

#include "calipso_fem/world/world.hpp"
#include "calipso_ros/node_reporter.hpp"
#include "calipso_ros/video_clock.hpp"
#include "calipso_scene/scene.hpp"
#include "simulator_params.hpp"

namespace calipso::fem {

// Wires the World to topics. camera_info is the clock: one state per stamp. All callbacks run in
// one thread.
class SimulatorRos {
 public:
  SimulatorRos(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  void onModels(const calipso_msgs::AlignedModelsConstPtr& models);
  void onClipInfo(const calipso_msgs::ClipInfoConstPtr& info);
  void onClipDynamics(const calipso_msgs::ClipDynamicsConstPtr& clip);
  void onLiveModes(const calipso_msgs::ClipDynamicsConstPtr& dynamics);
  void onStatus(const calipso_msgs::NodeStatusConstPtr& status);
  void onDynamics(const calipso_msgs::DynamicsConstPtr& dynamics);
  void onEdit(const calipso_msgs::EditConstPtr& edit);
  void onFrame(const sensor_msgs::CameraInfoConstPtr& info);

  void startOver(const ros::Time& stamp);
  void prepare();  // once everything it takes has arrived
  void take(const calipso_msgs::Dynamics& dynamics);
  void take(const calipso_msgs::ObjectClipDynamics& object);
  void submitAll();
  void submit(const calipso_msgs::Edit& edit);
  std::string whyImpossible(const calipso_msgs::Edit& edit) const;
  calipso_msgs::EditReport refusal(const calipso_msgs::Edit& edit,
                                   const std::string& message) const;
  void publish(const std::vector<EditOutcome>& outcomes, const ros::Time& stamp);
  void report(const calipso_msgs::EditReport& report);  // what a world says
  void send(const calipso_msgs::EditReport& report);
  void publishPlan(const ros::Time& stamp);
  calipso_msgs::SimulationState stateMsg(const WorldState& state, const ros::Time& stamp) const;
  void sendRigidTransforms(const WorldState& state, const ros::Time& stamp);

  SimulatorParams params_;
  Scene scene_;
  NodeReporter reporter_;
  tf2_ros::TransformBroadcaster tf_;
  ros::Publisher state_, plan_, applied_, markers_;
  std::vector<ros::Subscriber> subscribers_;
  VideoClock clock_;  // live
  calipso_msgs::AlignedModelsConstPtr models_;
  calipso_msgs::ClipDynamicsConstPtr clip_dynamics_;
  calipso_msgs::ClipInfoConstPtr clip_;
  std::optional<ros::Time> first_stamp_;
  ros::Time newest_;                       // frame's; zero: none to edit has come
  bool plays_ = false;                     // a frame to edit has come
  ros::Time plan_stamp_;                   // of the newest one sent
  std::uint32_t reports_ = 0;              // sent
  std::vector<calipso_msgs::Edit> edits_;  // of this video
  // what its worlds have said of them, and of that what the newest has yet to say again
  std::vector<calipso_msgs::EditReport> said_, said_before_;
  std::unique_ptr<World> world_;
};

}  // namespace calipso::fem

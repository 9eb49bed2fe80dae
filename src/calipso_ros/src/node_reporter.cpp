#include "calipso_ros/node_reporter.hpp"

#include <calipso_msgs/Timing.h>
#include <diagnostic_msgs/DiagnosticArray.h>

#include <iomanip>

#include "calipso_ros/topics.hpp"

namespace calipso {

using calipso_msgs::NodeStatus;
using diagnostic_msgs::DiagnosticStatus;

NodeReporter::NodeReporter(ros::NodeHandle& nh, const std::string& node) {
  constexpr bool kLatched = true;
  status_publisher_ = nh.advertise<NodeStatus>(topics::kStatus, 1000, kLatched);
  timing_publisher_ = nh.advertise<calipso_msgs::Timing>(topics::kTiming, 1000);
  diagnostics_publisher_ =
      nh.advertise<diagnostic_msgs::DiagnosticArray>(topics::kDiagnostics, 100);
  status_.node = node;
}

void NodeReporter::starting(const std::string& message) { publish(NodeStatus::STARTING, message); }
void NodeReporter::preparing(const std::string& message) {
  publish(NodeStatus::PREPARING, message);
}
void NodeReporter::ready(const std::string& message) { publish(NodeStatus::READY, message); }

void NodeReporter::failed(const std::string& message) {
  if (status_.state == NodeStatus::FAILED && status_.message == message) return;
  ROS_ERROR_STREAM(status_.node << ": " << message);
  publish(NodeStatus::FAILED, message);
  publishDiagnostic(ros::Time::now(), DiagnosticStatus::ERROR, message);
}

void NodeReporter::lastWords(const std::string& message) {
  constexpr double kStaySec = 10.0, kPollSec = 0.05;
  failed(message);
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(kStaySec);
  while (ros::ok() && ros::WallTime::now() < end) ros::WallDuration(kPollSec).sleep();
}

void NodeReporter::clipFrameDone() {
  ++status_.clip_frames;
  publish(status_.state, status_.message);
}

void NodeReporter::editReceived() {
  ++status_.edits;
  publish(status_.state, status_.message);
}

void NodeReporter::timing(const ros::Time& stamp, double ms) {
  calipso_msgs::Timing timing;
  timing.header.stamp = stamp;
  timing.node = status_.node;
  timing.ms = static_cast<float>(ms);
  timing_publisher_.publish(timing);
}

void NodeReporter::warn(const ros::Time& stamp, const std::string& message) {
  constexpr double kLogPeriodSec = 1.0;
  ROS_WARN_STREAM_THROTTLE(kLogPeriodSec, status_.node << ", frame " << std::fixed
                                                       << std::setprecision(3) << stamp.toSec()
                                                       << " s: " << message);
  publishDiagnostic(stamp, DiagnosticStatus::WARN, message);
}

void NodeReporter::remark(const std::string& message) {
  ROS_WARN_STREAM(status_.node << ": " << message);
  publishDiagnostic(ros::Time::now(), DiagnosticStatus::WARN, message);
}

void NodeReporter::publish(std::uint8_t state, const std::string& message) {
  status_.header.stamp = ros::Time::now();
  status_.state = state;
  status_.message = message;
  status_publisher_.publish(status_);
}

void NodeReporter::publishDiagnostic(const ros::Time& stamp, std::int8_t level,
                                     const std::string& message) {
  DiagnosticStatus status;
  status.level = level;
  status.name = "calipso: " + status_.node;
  status.hardware_id = "none";
  status.message = message;
  diagnostic_msgs::DiagnosticArray array;
  array.header.stamp = stamp;
  array.status.push_back(status);
  diagnostics_publisher_.publish(array);
}

}  // namespace calipso

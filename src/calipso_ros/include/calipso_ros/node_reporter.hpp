#pragma once

#include <calipso_msgs/NodeStatus.h>
#include <ros/ros.h>

#include <cstdint>
#include <string>

namespace calipso {

// Says how a node fares: its latched status, the time each frame took, and diagnostics.
// Not thread-safe: call from the node's callback thread.
class NodeReporter {
 public:
  // node: the name the player and the summary know it by (calipso_msgs/NodeStatus).
  NodeReporter(ros::NodeHandle& nh, const std::string& node);

  // To be called after the node has subscribed: the player then waits for the connections and
  // sends.
  void starting(const std::string& message);
  void preparing(const std::string& message);
  void ready(const std::string& message);
  void failed(const std::string& message);

  // As failed(), for a process about to end: stays for some seconds, as the player may start later
  // than the node fails, and would wait in vain for one that it never heard.
  void lastWords(const std::string& message);

  // One more frame of the clip has been taken in; lets the player send another.
  void clipFrameDone();

  // One more edit has come in, accepted or not; lets the player send the frame after it.
  void editReceived();

  void timing(const ros::Time& stamp, double ms);

  // Something went wrong with the frame of this stamp: published as a diagnostic, and logged, but
  // no more than once a second.
  void warn(const ros::Time& stamp, const std::string& message);

  // Something to know that concerns no frame, or is said once: a diagnostic, and always logged.
  void remark(const std::string& message);

  std::uint8_t state() const { return status_.state; }

 private:
  void publish(std::uint8_t state, const std::string& message);
  void publishDiagnostic(const ros::Time& stamp, std::int8_t level, const std::string& message);

  ros::Publisher status_publisher_;
  ros::Publisher timing_publisher_;
  ros::Publisher diagnostics_publisher_;
  calipso_msgs::NodeStatus status_;
};

}  // namespace calipso

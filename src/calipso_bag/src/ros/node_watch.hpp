#pragma once

#include <calipso_msgs/NodeStatus.h>
#include <ros/ros.h>

#include <map>
#include <set>
#include <string>

#include "calipso_bag/preparation.hpp"

namespace calipso::bag {

// Follows what the nodes say on `status`, prints what changes, and notices when a process ends:
// then says FAILED in its place, so that nobody waits for it. Not thread-safe.
class NodeWatch {
 public:
  NodeWatch(ros::NodeHandle& nh, Preparation::Roles roles);

  const Preparation& preparation() const { return preparation_; }

  // How many messages of status have come in; grows while anybody makes progress.
  int activity() const { return activity_; }

  // True when the node's process has ended. One that is started in its place stays out: it does not
  // know what went before.
  bool ended(const std::string& node) const { return preparation_.ended(node); }

  // ROS names of the nodes that have reported.
  std::set<std::string> rosNames() const;

  // Declares a node FAILED, to everyone.
  void fail(const std::string& node, const std::string& reason);

  // Says again who has FAILED: a node that failed at its start may have ended before all others
  // could hear it. To be called once the nodes are connected.
  void repeatFailures();

  // From now on nodes may end: the run is over.
  void runIsOver() { over_ = true; }

  // To be called when a subscriber's connection closes; `ros_name`: the subscriber's.
  void connectionLost(const std::string& ros_name);

 private:
  void onStatus(const ros::MessageEvent<calipso_msgs::NodeStatus const>& event);
  void hearOfEnded(const calipso_msgs::NodeStatus& status);

  void announceFailed(const std::string& node, const std::string& reason);

  Preparation preparation_;
  std::map<std::string, std::string> node_of_;  // ROS name -> name in NodeStatus
  std::map<std::string, std::string> last_said_;
  std::set<std::string> came_back_;
  int activity_ = 0;
  bool over_ = false;
  ros::Publisher publisher_;
  ros::Subscriber subscriber_;
};

}  // namespace calipso::bag

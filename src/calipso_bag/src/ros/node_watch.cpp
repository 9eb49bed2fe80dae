#include "node_watch.hpp"

#include <utility>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"

namespace calipso::bag {
namespace {

constexpr char kEnded[] = "its process ended";

}  // namespace

using calipso_msgs::NodeStatus;

NodeWatch::NodeWatch(ros::NodeHandle& nh, Preparation::Roles roles)
    : preparation_(std::move(roles)) {
  constexpr bool kLatched = true;
  publisher_ = nh.advertise<NodeStatus>(topics::kStatus, 100, kLatched);
  subscriber_ = nh.subscribe(topics::kStatus, 1000, &NodeWatch::onStatus, this);
}

void NodeWatch::fail(const std::string& node, const std::string& reason) {
  if (preparation_.standing(node).state == NodeState::kFailed) return;
  preparation_.fail(node, reason);
  ROS_ERROR_STREAM(node << ": " << reason << "; frames pass unedited where they need it");
  announceFailed(node, reason);
}

void NodeWatch::announceFailed(const std::string& node, const std::string& reason) {
  NodeStatus status;
  status.header.stamp = ros::Time::now();
  status.node = node;
  status.state = NodeStatus::FAILED;
  status.message = reason;
  publisher_.publish(status);
}

void NodeWatch::repeatFailures() {
  for (const std::string& node : preparation_.failed())
    announceFailed(node, preparation_.standing(node).message);
}

std::set<std::string> NodeWatch::rosNames() const {
  std::set<std::string> names;
  for (const auto& [ros_name, node] : node_of_) names.insert(ros_name);
  return names;
}

void NodeWatch::connectionLost(const std::string& ros_name) {
  const auto found = node_of_.find(ros_name);
  if (found == node_of_.end() || over_) return;
  const std::string& node = found->second;
  fail(node, kEnded);
  preparation_.end(node, nanoseconds(ros::Time::now()));
}

// Whoever has believed what the node says now is told that it stays FAILED.
void NodeWatch::hearOfEnded(const NodeStatus& status) {
  std::string reason = preparation_.standing(status.node).message;
  if (preparation_.saidBySuccessor(status.node, nanoseconds(status.header.stamp))) {
    reason =
        "started again in mid-run, it does not know the edits and frames before and stays out; "
        "stop this run and launch it anew";
    if (came_back_.insert(status.node).second) ROS_ERROR_STREAM(status.node << ": " << reason);
  }
  announceFailed(status.node, reason);
}

void NodeWatch::onStatus(const ros::MessageEvent<NodeStatus const>& event) {
  if (event.getPublisherName() == ros::this_node::getName()) return;
  ++activity_;
  const NodeStatus& status = *event.getMessage();
  node_of_[event.getPublisherName()] = status.node;
  if (ended(status.node)) {
    hearOfEnded(status);
    return;
  }
  NodeStanding standing;
  standing.state = static_cast<NodeState>(status.state);
  standing.message = status.message;
  standing.clip_frames = static_cast<int>(status.clip_frames);
  standing.edits = static_cast<int>(status.edits);
  preparation_.update(status.node, standing);

  std::string& said = last_said_[status.node];
  if (said == status.message || status.message.empty()) return;
  said = status.message;
  if (standing.state == NodeState::kFailed) return;  // the node has complained itself
  ROS_INFO_STREAM(status.node << ": " << said);
}

}  // namespace calipso::bag

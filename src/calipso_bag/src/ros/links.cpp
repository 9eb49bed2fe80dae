#include "links.hpp"

#include <ros/master.h>
#include <ros/this_node.h>

namespace calipso::bag {

// getSystemState answers [publishers, subscribers, services], each a list of [topic, [node, ...]].
Subscriptions registeredSubscriptions() {
  constexpr bool kKeepAsking = false;
  constexpr int kSubscribers = 1;
  XmlRpc::XmlRpcValue request, response, state;
  request[0] = ros::this_node::getName();
  Subscriptions registered;
  if (!ros::master::execute("getSystemState", request, response, state, kKeepAsking))
    return registered;
  XmlRpc::XmlRpcValue& topics = state[kSubscribers];
  for (int i = 0; i < topics.size(); ++i) {
    XmlRpc::XmlRpcValue& nodes = topics[i][1];
    for (int k = 0; k < nodes.size(); ++k) {
      registered[static_cast<std::string>(topics[i][0])].insert(static_cast<std::string>(nodes[k]));
    }
  }
  return registered;
}

std::vector<std::string> Links::missing(const Subscriptions& registered,
                                        const std::set<std::string>& topics,
                                        const std::set<std::string>& nodes) const {
  std::vector<std::string> names;
  for (const auto& [topic, subscribers] : registered) {
    if (topics.count(topic) == 0) continue;
    const auto open = open_.find(topic);
    for (const std::string& node : subscribers) {
      const bool connected = open != open_.end() && open->second.count(node) > 0;
      if (nodes.count(node) > 0 && !connected) names.push_back(topic + " to " + node);
    }
  }
  return names;
}

}  // namespace calipso::bag

#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

namespace calipso::bag {

// Subscribers by topic: full topic name -> ROS names of nodes.
using Subscriptions = std::map<std::string, std::set<std::string>>;

// What the master has on its books. Empty if it does not answer.
Subscriptions registeredSubscriptions();

// Which subscribers the topics of this process are connected to. A node subscribes with the master
// first and is connected some time later; what is published in between is lost to it.
class Links {
 public:
  void opened(const std::string& topic, const std::string& node) { open_[topic].insert(node); }
  void closed(const std::string& topic, const std::string& node) { open_[topic].erase(node); }

  // "topic to node" for each registered subscriber among `nodes` of a topic in `topics` that is not
  // connected yet.
  std::vector<std::string> missing(const Subscriptions& registered,
                                   const std::set<std::string>& topics,
                                   const std::set<std::string>& nodes) const;

 private:
  Subscriptions open_;
};

}  // namespace calipso::bag

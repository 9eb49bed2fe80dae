#pragma once

#include <ros/message_event.h>
#include <ros/time.h>

#include <functional>
#include <map>
#include <string>
#include <tuple>

#include "output_bag.hpp"

namespace calipso::bag {

// Writes messages in an order that depends on nothing but their content: by stamp, then topic, then
// the rank the caller gives. Holds what may still be overtaken. Not thread-safe.
class StampedWriter {
 public:
  explicit StampedWriter(OutputBag& output) : output_(output) {}

  // `rank` orders messages of one stamp and topic; equal ranks: the first one is kept.
  template <typename M>
  void add(const std::string& topic, const ros::Time& stamp, const std::string& rank,
           const boost::shared_ptr<M const>& message,
           const boost::shared_ptr<ros::M_string>& connection = nullptr) {
    waiting_.emplace(Key(stamp, topic, rank),
                     [=](OutputBag& out) { out.write(topic, stamp, message, connection); });
  }

  // Writes everything up to and including this stamp.
  void flush(const ros::Time& up_to);
  void flushAll();

 private:
  using Key = std::tuple<ros::Time, std::string, std::string>;  // stamp, topic, rank
  OutputBag& output_;
  std::map<Key, std::function<void(OutputBag&)>> waiting_;
};

}  // namespace calipso::bag

#include "wait.hpp"

#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <stdexcept>

namespace calipso::bag {

bool waitFor(const std::function<bool()>& done, double timeout_sec) {
  const ros::WallDuration longest_nap(0.05);
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(timeout_sec);
  while (!done()) {
    if (!ros::ok()) throw std::runtime_error("stopped before the end");
    if (ros::WallTime::now() >= end) return false;
    ros::getGlobalCallbackQueue()->callAvailable(longest_nap);
  }
  return true;
}

}  // namespace calipso::bag

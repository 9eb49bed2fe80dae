#include "calipso_ros/video_clock.hpp"

#include <algorithm>

namespace calipso {
namespace {

const ros::Duration kJump(
    0.5);  // longer than jitter and than nodes lag behind each other, shorter than a clip

}  // namespace

bool VideoClock::startsOver(const ros::Time& stamp) {
  const bool back = stamp + kJump < newest_;
  newest_ = back ? stamp : std::max(newest_, stamp);
  return back;
}

bool VideoClock::covers(const ros::Time& stamp) const { return stamp <= newest_ + kJump; }

}  // namespace calipso

#pragma once

#include <ros/time.h>

namespace calipso {

// What a node says when it forgets the video so far.
constexpr char kStartsOver[] = "the stamps went back: the video starts over, and this node with it";

// Live video's time, as its stamps tell it. They go back when a bag is played in a loop or a clock
// is set: what was learnt of the video before then holds no longer. Not thread-safe.
class VideoClock {
 public:
  // To be called with every frame's stamp. Whether the video starts over with this frame; a
  // camera's jitter is no start.
  bool startsOver(const ros::Time& stamp);

  // Whether a message about the frame of this stamp can be about the video as it runs now: what
  // other nodes still say of the time before it went back lies far ahead of the newest frame.
  bool covers(const ros::Time& stamp) const;

 private:
  ros::Time newest_;
};

}  // namespace calipso

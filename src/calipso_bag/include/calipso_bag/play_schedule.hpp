#pragma once

#include <cstdint>
#include <vector>

namespace calipso::bag {

// From `time_ns` on the video runs `factor` times as fast.
struct TimeScale {
  std::int64_t time_ns = 0;
  double factor = 1.0;  // (0, 1]
};

// One picture of the edited video.
struct PlayedFrame {
  int source = 0;            // index of the clip's frame it shows
  std::int64_t time_ns = 0;  // the instant of the scene it shows
};

// Slow motion: a clip played in `factor` of its speed has round(1 / factor) pictures for each
// interval between two frames. Their instants divide the interval evenly, so that everything
// simulated moves on in between; what is only seen in the video stands still until the next frame.
// Without scales: the clip as it is.
// @param frames_ns the clip's stamps, ascending
// @param scales in any order, the latest one before a frame counts
std::vector<PlayedFrame> playSchedule(const std::vector<std::int64_t>& frames_ns,
                                      std::vector<TimeScale> scales);

}  // namespace calipso::bag

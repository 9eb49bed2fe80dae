#include "calipso_bag/play_schedule.hpp"

#include <algorithm>
#include <cmath>

namespace calipso::bag {

std::vector<PlayedFrame> playSchedule(const std::vector<std::int64_t>& frames_ns,
                                      std::vector<TimeScale> scales) {
  std::stable_sort(scales.begin(), scales.end(),
                   [](const TimeScale& a, const TimeScale& b) { return a.time_ns < b.time_ns; });
  std::vector<PlayedFrame> played;
  std::size_t next = 0;
  std::int64_t parts = 1;
  for (std::size_t i = 0; i < frames_ns.size(); ++i) {
    for (; next < scales.size() && scales[next].time_ns <= frames_ns[i]; ++next)
      parts = std::max<std::int64_t>(1, std::llround(1.0 / scales[next].factor));
    const bool last = i + 1 == frames_ns.size();
    const std::int64_t interval = last ? 0 : frames_ns[i + 1] - frames_ns[i];
    for (std::int64_t k = 0; k < (last ? 1 : parts); ++k)
      played.push_back({static_cast<int>(i), frames_ns[i] + interval * k / parts});
  }
  return played;
}

}  // namespace calipso::bag

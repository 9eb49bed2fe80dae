#include "frame/revealed_place.hpp"

namespace calipso::render {

RevealedPlace::RevealedPlace(const StagedFrame& frame, const SeenPlace& place,
                             const Reflections& reflections)
    : frame_(frame), place_(place), unmirrored_(reflections.unmirrored()) {
  if (place.live == nullptr) return;
  covered_ = frame.prepared.background.passing.addedTo(frame.labels, unmirrored_);
  corrections_ = place.live->corrections(unmirrored_, covered_);
}

Pixel RevealedPlace::at(int u, int v) const {
  const bool invented = place_.invented.at<std::uint8_t>(v, u) != 0;
  cv::Vec3f now;
  if (invented && !drifts(u, v) && place_.live != nullptr &&
      place_.live->at(unmirrored_, covered_, corrections_,
                      frame_.prepared.noise.deviation(1, 128.0f), u, v, now)) {
    for (int c = 0; c < 3; ++c) now[c] = linearFromRealCode(now[c]);
    return {now, 1.0f, kInvented};
  }
  return {place_.plate.at<cv::Vec3f>(v, u), 1.0f, invented ? kInvented : kSeenElsewhere};
}

}  // namespace calipso::render

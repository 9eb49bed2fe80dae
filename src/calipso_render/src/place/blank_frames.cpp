#include "place/blank_frames.hpp"

#include <algorithm>

namespace calipso::render {
namespace {

constexpr int kStride = 4;  // px between those that are looked at
constexpr std::uint8_t kBlack = 5,
                       kWhite = 250;  // code values up to and from which all channels are
constexpr double kMost = 0.5;         // part of a frame that is blank

bool isBlank(const ClipFrame& frame) {
  int blank = 0, all = 0;
  for (int v = 0; v < frame.bgr.rows; v += kStride) {
    const cv::Vec3b* codes = frame.bgr.ptr<cv::Vec3b>(v);
    for (int u = 0; u < frame.bgr.cols; u += kStride) {
      const auto [low, high] = std::minmax({codes[u][0], codes[u][1], codes[u][2]});
      blank += high <= kBlack || low >= kWhite ? 1 : 0, ++all;
    }
  }
  return blank > kMost * all;
}

}  // namespace

std::optional<ClipSample> withoutBlankFrames(const ClipSample& clip) {
  const std::vector<ClipFrame>& frames = clip.frames();
  std::vector<bool> blank;
  for (const ClipFrame& f : frames) blank.push_back(isBlank(f));
  const auto blanks = std::count(blank.begin() + 1, blank.end(), true);
  if (blanks == 0 || 2 * static_cast<std::size_t>(blanks) > frames.size()) return std::nullopt;
  ClipSample kept(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (i == 0 || !blank[i]) kept.add(frames[i]);
  }
  return kept;
}

}  // namespace calipso::render

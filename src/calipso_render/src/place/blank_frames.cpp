#include "place/blank_frames.hpp"

#include <algorithm>
#include <vector>

namespace calipso::render {
namespace {

constexpr int kStride = 4;                       // px between those that are looked at
constexpr float kBlack = 5.0f, kWhite = 250.0f;  // code values to and from which all channels are
// parts of a picture: most of it, and more than of another
constexpr double kMost = 0.5, kMore = 0.4;

// Part of a picture that is white or black.
double blankPart(const cv::Mat& picture) {
  int blank = 0, all = 0;
  for (int v = 0; v < picture.rows; v += kStride) {
    for (int u = 0; u < picture.cols; u += kStride) {
      const cv::Vec3f code = picture.depth() == CV_8U ? cv::Vec3f(picture.at<cv::Vec3b>(v, u))
                                                      : picture.at<cv::Vec3f>(v, u);
      const auto [low, high] = std::minmax({code[0], code[1], code[2]});
      blank += high <= kBlack || low >= kWhite ? 1 : 0, ++all;
    }
  }
  return static_cast<double>(blank) / std::max(1, all);
}

bool isBlank(double part, double usual) { return part > kMost && part > usual + kMore; }

}  // namespace

bool isBlankAgainst(const cv::Mat& bgr, const cv::Mat& usual) {
  const double part = blankPart(bgr);
  return part > kMost && isBlank(part, blankPart(usual));
}

std::optional<ClipSample> withoutBlankFrames(const ClipSample& clip) {
  const std::vector<ClipFrame>& frames = clip.frames();
  std::vector<double> parts;
  for (const ClipFrame& f : frames) parts.push_back(blankPart(f.bgr));
  std::vector<double> sorted = parts;
  std::sort(sorted.begin(), sorted.end());
  const double usual = sorted[sorted.size() / 2];
  if (std::none_of(parts.begin() + 1, parts.end(), [&](double p) { return isBlank(p, usual); }))
    return std::nullopt;
  ClipSample kept(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (i == 0 || !isBlank(parts[i], usual)) kept.add(frames[i]);
  }
  return kept;
}

}  // namespace calipso::render

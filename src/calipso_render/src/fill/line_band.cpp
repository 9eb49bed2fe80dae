#include "fill/line_band.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

namespace calipso::render {
namespace {

constexpr int kWidest = 20;              // px
constexpr int kFirst = 2, kLast = 22;    // px before an end at which it is looked at
constexpr int kFewest = 14;              // of them that are known
constexpr float kAlongDeviation = 8.0f;  // code values by which what runs along a line varies
constexpr float kDifference = 10.0f;     // and by which its ends differ
constexpr float kEdge = 10.0f;  // from one px to the next but one, from which there is an edge
constexpr int kPast = 2;        // px that belong to one, past its middle

// Mean of what is seen `s` px beside a line before its end; nothing if it is not the same along it.
// @param into direction towards the other one
std::optional<cv::Vec3f> evenBeside(const LineEnd& end, const cv::Point2f& into, int s,
                                    const cv::Mat& source, const cv::Mat& image) {
  cv::Vec3f sum;
  float squares = 0.0f;
  int count = 0;
  for (int t = kFirst; t <= kLast; ++t) {
    const cv::Point2f p =
        end.at - static_cast<float>(t) * into + static_cast<float>(s) * leftOf(into);
    if (!isSet(source, p)) continue;
    const cv::Vec3f c = sampleSeen(image, source, p);
    sum += c, squares += c.dot(c), ++count;
  }
  if (count < kFewest) return std::nullopt;
  const cv::Vec3f mean = sum / count;
  const float variance = (squares / static_cast<float>(count) - mean.dot(mean)) / 3.0f;
  if (variance > kAlongDeviation * kAlongDeviation) return std::nullopt;
  return mean;
}

// On one side: to its last edge.
float widthOf(const LineEnd& from, const LineEnd& to, int side, const cv::Mat& source,
              const cv::Mat& image) {
  const cv::Point2f along = (to.at - from.at) / cv::norm(to.at - from.at);
  std::vector<cv::Vec3f> across;
  int last = kLineHalf;
  for (int s = kLineHalf - 1; s <= kWidest; ++s) {
    const auto here = evenBeside(from, along, side * s, source, image),
               there = evenBeside(to, -along, -side * s, source, image);
    if (!here || !there || rms(*here - *there) > kDifference) break;
    across.push_back(*here);
    const std::size_t n = across.size();
    if (n > 2 && rms(across[n - 1] - across[n - 3]) > kEdge) last = s - 1 + kPast;
  }
  return static_cast<float>(std::min(last, kLineHalf - 2 + static_cast<int>(across.size())));
}

}  // namespace

LineBand bandAlong(const LineEnd& from, const LineEnd& to, const cv::Mat& source,
                   const cv::Mat& image) {
  const auto width = [&](int side) {
    return std::max(1.0f * kLineHalf, widthOf(from, to, side, source, image));
  };
  return {width(1), width(-1)};
}

}  // namespace calipso::render

#include "place/sure_surfaces.hpp"

#include <opencv2/imgproc.hpp>

#include "fill/distances_to.hpp"

namespace calipso::render {
namespace {

constexpr int kCopied = 6;  // px around a place that are plane, for it to be copied from

}  // namespace

cv::Mat sureOf(const cv::Mat& label, const cv::Mat& hidden, const cv::Mat& seen,
               const cv::Mat& nothing, const Edges& edges) {
  const cv::Mat large = cv::Mat::ones(2 * kCopied + 1, 2 * kCopied + 1, CV_8U),
                small = cv::Mat::ones(5, 5, CV_8U);
  cv::Mat sure = hidden == 0;
  for (int k = 0; k < static_cast<int>(edges.size()); ++k) {
    const cv::Mat wanted = hidden & (label == k + 1);
    if (cv::countNonZero(wanted) == 0) continue;
    cv::Mat on, other;  // of both what is large enough to be copied from
    cv::morphologyEx(seen == k, on, cv::MORPH_OPEN, large, {-1, -1}, 1, cv::BORDER_REPLICATE);
    cv::morphologyEx(nothing | ((hidden == 0) & (seen != k)), other, cv::MORPH_OPEN, small,
                     {-1, -1}, 1, cv::BORDER_REPLICATE);
    for (int j = 0; j < static_cast<int>(edges.size()); ++j) {
      if (edges[k][j] != kApart) other.setTo(0, seen == j);
    }
    if (cv::countNonZero(on) == 0) continue;
    const auto [to_on, to_other] = distancesTo(on, other);
    sure |= wanted & (to_on < to_other);
  }
  return sure;
}

}  // namespace calipso::render

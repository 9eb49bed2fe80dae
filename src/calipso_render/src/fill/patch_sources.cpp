#include "fill/patch_sources.hpp"

#include <algorithm>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "fill/patch_cost.hpp"

namespace calipso::render {
namespace {

constexpr int kRowsBeside = 1;

}  // namespace

PatchSources::PatchSources(const cv::Mat& source, const cv::Mat& surface)
    : row_starts_(source.rows + 1, 0) {
  cv::erode(source, whole_, cv::Mat::ones(kPatchSide, kPatchSide, CV_8U), {-1, -1}, 1,
            cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::findNonZero(whole_, all_);
  for (const cv::Point& p : all_) ++row_starts_[p.y + 1];
  if (!surface.empty()) {
    std::array<std::size_t, 256> counts = {};
    for (const cv::Point& p : all_) ++counts[surface.at<std::uint8_t>(p)];
    for (std::size_t label = 1; label < counts.size(); ++label)
      on_surface_[label].reserve(counts[label]);
    for (const cv::Point& p : all_) {
      const int label = surface.at<std::uint8_t>(p);
      if (label != 0) on_surface_[label].push_back(p);
    }
  }
  std::partial_sum(row_starts_.begin(), row_starts_.end(), row_starts_.begin());
}

const cv::Point& PatchSources::oneInRow(int row, std::uint32_t number) const {
  const std::uint32_t first = row_starts_[std::max(0, row - kRowsBeside)],
                      last = row_starts_[std::min(whole_.rows, row + kRowsBeside + 1)];
  return first == last ? one(number) : all_[first + number % (last - first)];
}

}  // namespace calipso::render

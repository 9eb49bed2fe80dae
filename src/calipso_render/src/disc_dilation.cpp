#include "disc_dilation.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "marked.hpp"

namespace calipso::render {
namespace {

// Per row of the disc, how far its run reaches from the middle.
std::vector<int> runsOf(int radius) {
  const cv::Mat disc =
      cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1});
  std::vector<int> runs;
  for (int j = 0; j < disc.rows; ++j) runs.push_back((cv::countNonZero(disc.row(j)) - 1) / 2);
  return runs;
}

void takeGreater(const std::uint8_t* from, int count, std::uint8_t* to) {
  for (int i = 0; i < count; ++i) to[i] = std::max(to[i], from[i]);
}

}  // namespace

void dilateByDisc(const cv::Mat& from, int radius, cv::Mat& to) {
  const std::vector<int> runs = runsOf(radius);
  cv::Size whole;
  cv::Point corner;
  from.locateROI(whole, corner);
  const int width = from.cols, left = std::min(radius, corner.x),
            right = std::min(radius, whole.width - corner.x - width);
  std::vector<std::uint8_t> row(width + 2 * radius), run(width);
  for (int v = 0; v < to.rows; ++v) std::memset(to.ptr(v), 0, to.cols);
  for (int v = -std::min(radius, corner.y);
       v < from.rows + std::min(radius, whole.height - corner.y - from.rows); ++v) {
    std::memcpy(
        &row[radius - left],
        from.data + static_cast<std::ptrdiff_t>(v) * static_cast<std::ptrdiff_t>(from.step) - left,
        left + width + right);
    if (nextMarked(row.data(), 0, width + 2 * radius) == width + 2 * radius) continue;
    std::copy_n(&row[radius], width, run.begin());
    for (int reach = 0; reach <= radius; ++reach) {
      if (reach > 0)
        takeGreater(&row[radius - reach], width, run.data()),
            takeGreater(&row[radius + reach], width, run.data());
      for (int j = 0; j <= 2 * radius; ++j) {
        const int target = v + j - radius;
        if (runs[j] == reach && target >= 0 && target < to.rows)
          takeGreater(run.data(), width, to.ptr<std::uint8_t>(target));
      }
    }
  }
}

}  // namespace calipso::render

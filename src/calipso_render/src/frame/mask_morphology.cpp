#include "frame/mask_morphology.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "draw/wide_loops.hpp"
#include "frame/marked.hpp"

namespace calipso::render {
namespace {

inline void takeGreater(const std::uint8_t* from, int count, std::uint8_t* to) {
  for (int i = 0; i < count; ++i) to[i] = std::max(to[i], from[i]);
}

// Greatest of a pixel of row b and its eight neighbours; with flip = 255 the least.
// @param greatest room for `count` and two more
CALIPSO_WIDE_LOOPS void greatestAround(const std::uint8_t* a, const std::uint8_t* b,
                                       const std::uint8_t* c, int count, std::uint8_t flip,
                                       std::uint8_t* greatest, std::uint8_t* out) {
  greatest[0] = greatest[count + 1] = 0;
  for (int i = 0; i < count; ++i)
    greatest[i + 1] = std::max(std::max<std::uint8_t>(a[i] ^ flip, b[i] ^ flip),
                               static_cast<std::uint8_t>(c[i] ^ flip));
  for (int i = 0; i < count; ++i)
    out[i] = std::max(std::max(greatest[i], greatest[i + 1]), greatest[i + 2]) ^ flip;
}

cv::Mat dilatedByThree(const cv::Mat& mask, std::uint8_t flip) {
  cv::Mat out(mask.size(), CV_8U);
#pragma omp parallel
  {
    std::vector<std::uint8_t> greatest(mask.cols + 2);
#pragma omp for schedule(static)
    for (int v = 0; v < mask.rows; ++v)
      greatestAround(mask.ptr(std::max(v - 1, 0)), mask.ptr(v),
                     mask.ptr(std::min(v + 1, mask.rows - 1)), mask.cols, flip, greatest.data(),
                     out.ptr(v));
  }
  return out;
}

}  // namespace

DiscDilation::DiscDilation(int radius) : rows_(radius + 1) {
  const cv::Mat disc =
      cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1});
  for (int j = 0; j < disc.rows; ++j)
    rows_[(cv::countNonZero(disc.row(j)) - 1) / 2].push_back(j - radius);
}

void DiscDilation::operator()(const cv::Mat& from, cv::Mat& to) const {
  const int radius = static_cast<int>(rows_.size()) - 1, width = from.cols;
  cv::Size whole;
  cv::Point corner;
  from.locateROI(whole, corner);
  const int left = std::min(radius, corner.x),
            right = std::min(radius, whole.width - corner.x - width);
  std::vector<std::uint8_t> row(width + 2 * radius);
  for (int v = 0; v < to.rows; ++v) std::memset(to.ptr(v), 0, to.cols);
  for (int v = -std::min(radius, corner.y);
       v < from.rows + std::min(radius, whole.height - corner.y - from.rows); ++v) {
    std::memcpy(
        &row[radius - left],
        from.data + static_cast<std::ptrdiff_t>(v) * static_cast<std::ptrdiff_t>(from.step) - left,
        left + width + right);
    if (nextMarked(row.data(), 0, width + 2 * radius) < width + 2 * radius) takeRow(row, v, to);
  }
}

// What row v of the source, with `radius` pixels on either side, adds to the rows around.
CALIPSO_WIDE_LOOPS void DiscDilation::takeRow(const std::vector<std::uint8_t>& row, int v,
                                              cv::Mat& to) const {
  const int radius = static_cast<int>(rows_.size()) - 1, width = to.cols;
  std::vector<std::uint8_t> run(&row[radius], &row[radius] + width);
  for (int reach = 0; reach <= radius; ++reach) {
    if (reach > 0)
      takeGreater(&row[radius - reach], width, run.data()),
          takeGreater(&row[radius + reach], width, run.data());
    for (const int j : rows_[reach]) {
      if (v + j >= 0 && v + j < to.rows) takeGreater(run.data(), width, to.ptr(v + j));
    }
  }
}

cv::Mat openedByThree(const cv::Mat& mask) { return dilatedByThree(dilatedByThree(mask, 255), 0); }

}  // namespace calipso::render

#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>

#include "frame/mask_morphology.hpp"

namespace calipso::render {

// Runs a neighbourhood filter over a mask by tiles, on all threads. A tile whose surroundings have
// one value keeps it, as under erosion, dilation or a mean; the others go through `filter(source,
// target)`, which sees the pixels around a tile as OpenCV's filters do.
// @param source CV_8UC1 that owns its pixels
// @param reach of the filter, px
// @param target CV_8UC1 of the same size, not the source
template <class Filter>
void filterTiles(const cv::Mat& source, int reach, cv::Mat target, const Filter& filter) {
  constexpr int kWidth = 64, kHeight = 32;
  const int across = (source.cols + kWidth - 1) / kWidth,
            down = (source.rows + kHeight - 1) / kHeight;
  const cv::Rect all(cv::Point(), source.size());
#pragma omp parallel for schedule(dynamic, 2)
  for (int k = 0; k < across * down; ++k) {
    const cv::Rect tile =
        cv::Rect(k % across * kWidth, k / across * kHeight, kWidth, kHeight) & all;
    const cv::Rect around = grown(tile, reach) & all;
    std::uint8_t low = 255, high = 0;
    for (int v = around.y; v < around.br().y; ++v) {
      const std::uint8_t* row = source.ptr<std::uint8_t>(v);
      for (int u = around.x; u < around.br().x; ++u)
        low = std::min(low, row[u]), high = std::max(high, row[u]);
    }
    cv::Mat out = target(tile);
    if (low != high) filter(source(tile), out);
    for (int v = 0; low == high && v < out.rows; ++v) std::memset(out.ptr(v), low, out.cols);
  }
}

}  // namespace calipso::render

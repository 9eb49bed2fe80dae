#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "fill/lattice.hpp"

namespace calipso::render {

// By which shifts a picture repeats itself.
struct Pattern {
  std::optional<Lattice> lattice;  // all of it, or
  bool striped = false;            // only along its rows, in stripes:
  std::vector<float> periods;      // px, by row, 0 unknown

  // The shift from a row that repeats the picture and is nearest to one; nothing where none is known.
  std::optional<cv::Point2f> nearest(int row, const cv::Point2f& shift) const {
    if (lattice) return lattice->nearest(shift);
    if (row < 0 || row >= static_cast<int>(periods.size()) || periods[row] <= 0.0f) return {};
    return cv::Point2f(periods[row] * std::round(shift.x / periods[row]), shift.y);
  }

  // That of the same picture, so many times smaller.
  Pattern shrunk(float scale, int rows) const {
    Pattern small = *this;
    if (lattice) small.lattice = Lattice{(1.0f / scale) * lattice->basis, scale * lattice->inverse};
    if (periods.empty()) return small;
    small.periods.assign(rows, 0.0f);
    for (int row = 0; row < rows; ++row) {
      const int fine = cvRound(scale * (static_cast<float>(row) + 0.5f) - 0.5f);
      if (fine < static_cast<int>(periods.size())) small.periods[row] = periods[fine] / scale;
    }
    return small;
  }
};

}  // namespace calipso::render

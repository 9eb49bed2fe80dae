#pragma once

#include <algorithm>
#include <cstdint>
#include <opencv2/core.hpp>
#include <utility>

namespace calipso::render {

// A mask over a part of the picture, by squares that hang on the picture, not on the part.
class SquareMask {
 public:
  static constexpr int kSide = 8;  // px

  SquareMask() = default;

  // None of the squares that have pixels of the part.
  explicit SquareMask(const cv::Rect& part);

  // The squares of which all pixels, and all within `margin` px, are set; beyond the part all are.
  // @param pixels CV_8UC1 over `part`
  SquareMask(const cv::Mat& pixels, const cv::Rect& part, int margin);

  // Sets the squares that have pixels of `rect`. Different threads may set different squares.
  void set(const cv::Rect& rect) {
    const cv::Rect squares = squaresOf(rect);
    for (int j = squares.y; j < squares.br().y; ++j)
      std::fill_n(set_.ptr<std::uint8_t>(j) + squares.x, squares.width, 255);
  }
  // Also the squares that are set in `other`.
  void add(const SquareMask& other);
  // Not those that are set in `other`.
  void remove(const SquareMask& other);
  // The squares within `margin` px of those that are set.
  SquareMask grown(int margin) const;
  // The pixels of all squares that are set.
  cv::Rect box() const;

  // Picture coordinates; beyond the part nothing is set.
  bool at(int u, int v) const {
    const int i = u / kSide - first_.x, j = v / kSide - first_.y;
    return i >= 0 && j >= 0 && i < set_.cols && j < set_.rows && set_.at<std::uint8_t>(j, i) != 0;
  }
  bool all(const cv::Rect& rect) const {
    const cv::Rect squares = squaresOf(rect);
    return !set_.empty() && squares.size() == wholeSquaresOf(rect).size() &&
           cv::countNonZero(set_(squares)) == squares.area();
  }

  // Calls visit(begin, end) for the runs of row v's pixels that are set, within columns [from, to).
  template <class Visit>
  void visitRow(int v, int from, int to, const Visit& visit) const {
    const int j = v / kSide - first_.y;
    if (j < 0 || j >= set_.rows) return;
    const std::uint8_t* row = set_.ptr<std::uint8_t>(j);
    const int last = std::min(set_.cols, (to - 1) / kSide + 1 - first_.x);
    for (int i = std::max(0, from / kSide - first_.x); i < last; ++i) {
      if (row[i] == 0) continue;
      const int begin = i;
      while (i < last && row[i] != 0) ++i;
      visit(std::max(from, (first_.x + begin) * kSide), std::min(to, (first_.x + i) * kSide));
    }
  }

 private:
  static cv::Rect wholeSquaresOf(const cv::Rect& rect) {
    const cv::Point low(rect.x / kSide, rect.y / kSide),
        high((rect.br().x - 1) / kSide, (rect.br().y - 1) / kSide);
    return {low, high + cv::Point(1, 1)};
  }
  // Their places in set_, of those that it has.
  cv::Rect squaresOf(const cv::Rect& rect) const {
    return (wholeSquaresOf(rect) - first_) & cv::Rect({0, 0}, set_.size());
  }
  // The squares that both have. @return their places in this mask, then in `other`
  std::pair<cv::Rect, cv::Rect> shared(const SquareMask& other) const {
    const cv::Rect both = cv::Rect(first_, set_.size()) & cv::Rect(other.first_, other.set_.size());
    return {both - first_, both - other.first_};
  }

  cv::Mat set_;      // CV_8UC1, per square
  cv::Point first_;  // square
};

}  // namespace calipso::render

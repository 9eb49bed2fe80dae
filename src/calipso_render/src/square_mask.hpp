#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace calipso::render {

// A mask over a part of the picture, by squares that hang on the picture, not on the part.
class SquareMask {
 public:
  static constexpr int kSide = 8;  // px

  SquareMask() = default;

  // The squares of which all pixels, and all within `margin` px, are set; beyond the part all are.
  // @param pixels CV_8UC1 over `part`
  SquareMask(const cv::Mat& pixels, const cv::Rect& part, int margin);

  // Picture coordinates; beyond the part nothing is set.
  bool at(int u, int v) const {
    const int i = u / kSide - first_.x, j = v / kSide - first_.y;
    return i >= 0 && j >= 0 && i < set_.cols && j < set_.rows && set_.at<std::uint8_t>(j, i) != 0;
  }
  bool all(const cv::Rect& rect) const {
    return !set_.empty() && cv::countNonZero(set_(squaresOf(rect))) == squaresOf(rect).area();
  }

 private:
  cv::Rect squaresOf(const cv::Rect& rect) const {
    const cv::Point low(rect.x / kSide, rect.y / kSide),
        high((rect.br().x - 1) / kSide, (rect.br().y - 1) / kSide);
    return (cv::Rect(low, high + cv::Point(1, 1)) - first_) & cv::Rect({0, 0}, set_.size());
  }

  cv::Mat set_;      // CV_8UC1, per square
  cv::Point first_;  // square
};

}  // namespace calipso::render

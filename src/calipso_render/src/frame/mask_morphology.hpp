#pragma once

#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace calipso::render {

inline cv::Mat disc(int radius) {
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1});
}

// With a margin on all sides; nothing stays nothing.
inline cv::Rect grown(const cv::Rect& r, int margin) {
  if (r.empty()) return r;
  return {r.x - margin, r.y - margin, r.width + 2 * margin, r.height + 2 * margin};
}

// cv::dilate() with disc(radius). A disc's rows are runs, and a longer run is a shorter one with a
// pixel more at either end.
class DiscDilation {
 public:
  explicit DiscDilation(int radius);

  // @param from CV_8UC1; of a part of a picture also the pixels around it count
  // @param to CV_8UC1 of its size, not the source
  void operator()(const cv::Mat& from, cv::Mat& to) const;

 private:
  void takeRow(const std::vector<std::uint8_t>& row, int v, cv::Mat& to) const;

  // per reach of a run from its middle: the disc's rows that have it, from the centre
  std::vector<std::vector<int>> rows_;
};

// cv::erode() with 3 x 3 pixels, then cv::dilate(). @return CV_8UC1 of the mask's size
cv::Mat openedByThree(const cv::Mat& mask);

}  // namespace calipso::render

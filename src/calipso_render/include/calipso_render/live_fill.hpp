#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// Fills holes of a place that moves by itself (clouds, water) from the frame at hand: every hole
// pixel shows what this frame shows at its origin, so that it moves like its surroundings. Where
// copies of different places meet, or a copy and the picture, their mean colours are drawn
// together.
class LiveFill {
 public:
  LiveFill() = default;
  // @param origin CV_16SC2: what a hole pixel is a copy of; (-1, -1): it is no hole, or nothing
  // that moves
  // @param hole CV_8UC1, all that is not seen
  LiveFill(const cv::Mat& origin, const cv::Mat& hole);

  bool empty() const { return origin_.empty(); }

  // A frame's corrections at the seams, in the order of the seams.
  // @param bgr CV_8UC3; labels CV_8UC1, 0: the place itself is seen
  std::vector<cv::Vec3f> corrections(const cv::Mat& bgr, const cv::Mat& labels) const;

  // The pixel's colour in code values, with the camera's noise smoothed away. @param noise its
  // deviation, code values
  // @return false where this fill has none, or the frame hides its origin
  bool at(const cv::Mat& bgr, const cv::Mat& labels, const std::vector<cv::Vec3f>& corrections,
          float noise, int u, int v, cv::Vec3f& colour) const;

 private:
  struct Seam {
    cv::Point other,
        own;  // places that should look alike: beyond the seam, and what this side's copy has there
    float share;  // of the difference that this side takes
  };
  void addSeams(const cv::Mat& hole);

  cv::Mat origin_, seam_, weight_;  // CV_16SC2; CV_32SC1, -1: none near; CV_32FC1
  std::vector<Seam> seams_;
};

}  // namespace calipso::render

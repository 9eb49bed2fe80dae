#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// Air adds light of its own to what is seen through much of it, and no shadow darkens that
// (Koschmieder 1924):
//   I = J exp(-b d) + A (1 - exp(-b d))
//   I, J  linear colour, seen and without air    b  extinction, 1/m
//   A     light of the air: the sky's at the horizon    d  distance, m
// J is about 0 for what is darkest at a distance (He et al. 2009), which tells b.
class Haze {
 public:
  Haze() = default;  // clear air

  // Established only if the law explains what is darkest at most distances, over a range of them.
  // @param picture CV_32FC3, code values
  // @param nearness CV_32FC1, 1/m, of what is no object; 0 unknown
  // @param sky CV_8UC1, != 0: sky
  Haze(const cv::Mat& picture, const cv::Mat& nearness, const cv::Mat& sky);

  bool established() const { return extinction_ > 0.0f; }
  // What it adds, linear.
  cv::Vec3f addedAt(float nearness) const;

 private:
  cv::Vec3f air_;
  float extinction_ = 0.0f;
};

// CV_32FC3, code values, without it.
cv::Mat withoutHaze(const Haze& haze, const cv::Mat& picture, const cv::Mat& nearness);

// CV_8UC1: part of what a pixel shows that haze adds, 255 = all. Empty in clear air.
cv::Mat veilOf(const Haze& haze, const cv::Mat& plate_linear, const cv::Mat& nearness);

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>

namespace calipso::render::testing {

// Grain without any repetition, the same in every run.
inline cv::Mat grain(int width, int height) {
  cv::Mat image(height, width, CV_32FC3);
  cv::RNG random(11);
  random.fill(image, cv::RNG::UNIFORM, 40.0, 200.0);
  return image;
}

// Its left part again at the right, `period` px on.
inline cv::Mat repeated(cv::Mat image, int period) {
  for (int u = period; u < image.cols; ++u) image.col(u - period).copyTo(image.col(u));
  return image;
}

inline double meanDifference(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask) {
  cv::Mat difference;
  cv::absdiff(a, b, difference);
  const cv::Scalar mean = cv::mean(difference, mask);
  return (mean[0] + mean[1] + mean[2]) / 3.0;
}

}  // namespace calipso::render::testing

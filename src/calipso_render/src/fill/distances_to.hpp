#pragma once

#include <opencv2/imgproc.hpp>
#include <utility>

#include "draw/side_by_side.hpp"

namespace calipso::render {

// CV_32FC1: px to the nearest pixel that is set, by either of two masks, CV_8UC1.
inline std::pair<cv::Mat, cv::Mat> distancesTo(const cv::Mat& one, const cv::Mat& other) {
  std::pair<cv::Mat, cv::Mat> px;
  const auto measure = [](const cv::Mat& to, cv::Mat& from_all) {
    cv::distanceTransform(to == 0, from_all, cv::DIST_L2, cv::DIST_MASK_5);
  };
  doAll(true, {[&] { measure(one, px.first); }, [&] { measure(other, px.second); }});
  return px;
}

}  // namespace calipso::render

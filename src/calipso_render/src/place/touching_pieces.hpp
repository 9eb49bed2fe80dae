#pragma once

#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace calipso::render {

// Of a mask the connected pieces that reach into another one. CV_8UC1, all
inline cv::Mat touchingPieces(const cv::Mat& mask, const cv::Mat& other) {
  cv::Mat pieces, found = cv::Mat::zeros(mask.size(), CV_8U);
  std::vector<char> reaches(cv::connectedComponents(mask, pieces, 8, CV_32S), 0);
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) {
      if (other.at<std::uint8_t>(v, u) != 0) reaches[pieces.at<int>(v, u)] = 1;
    }
  }
  reaches[0] = 0;  // what is no piece
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) {
      if (reaches[pieces.at<int>(v, u)] != 0) found.at<std::uint8_t>(v, u) = 255;
    }
  }
  return found;
}

}  // namespace calipso::render

#include "unshown_holes.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace calipso::align {

cv::Mat1b withoutHoles(const cv::Mat1b& mask) {
  std::vector<std::vector<cv::Point>> outer;
  cv::findContours(mask.clone(), outer, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::Mat1b filled = mask.clone();
  cv::drawContours(filled, outer, -1, cv::Scalar(255), cv::FILLED);
  return filled;
}

double unshownHoles(const cv::Mat1b& mask, const cv::Mat1b& other, double tolerance_px) {
  constexpr double kRimPx = 0.5;  // from a pixel's middle to its side
  const cv::Mat1b holes = withoutHoles(mask) & ~mask;
  cv::Mat1f to_rim, to_open;
  cv::distanceTransform(holes, to_rim, cv::DIST_L2, cv::DIST_MASK_5);
  cv::distanceTransform(other, to_open, cv::DIST_L2, cv::DIST_MASK_5);
  cv::Mat labels;
  const int count = cv::connectedComponents(holes, labels, 4, CV_32S);

  std::vector<double> area(count, 0.0), deep(count, 0.0);
  for (int v = 0; v < holes.rows; ++v) {
    for (int u = 0; u < holes.cols; ++u) {
      const int hole = labels.at<int>(v, u);
      if (hole == 0 || !other(v, u)) continue;
      area[hole] += 1.0;
      deep[hole] = std::max<double>(deep[hole], std::min(to_rim(v, u), to_open(v, u)));
    }
  }
  double sum = 0.0;
  for (int hole = 1; hole < count; ++hole) {
    if (deep[hole] - kRimPx > tolerance_px) sum += area[hole];
  }
  return sum;
}

}  // namespace calipso::align

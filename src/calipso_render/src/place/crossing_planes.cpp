#include "place/crossing_planes.hpp"

#include <cstdint>
#include <opencv2/imgproc.hpp>

#include "place/plane_reach.hpp"

namespace calipso::render {
namespace {

// of a strip that may touch what the support alone explains, of a layer what the other plane does
constexpr float kApart = 0.03f;

// CV_8UC1: 255 where both planes explain what is taken for the support.
cv::Mat crossing(const cv::Mat& scenery, const PlaneExtent& other, const cv::Mat& on_support) {
  cv::Mat both = cv::Mat::zeros(scenery.size(), CV_8U);
  for (int v = 0; v < scenery.rows; ++v) {
    for (int u = 0; u < scenery.cols; ++u) {
      if (on_support.at<std::uint8_t>(v, u) != 0 &&
          other.miss(scenery.at<float>(v, u), u, v) < kOnPlane)
        both.at<std::uint8_t>(v, u) = 255;
    }
  }
  return both;
}

// Of what both explain the pieces apart from what one of them alone explains: where a wall stands
// on a support they hang together.
cv::Mat apartFrom(const cv::Mat& alone, const cv::Mat& both) {
  cv::Mat pieces, beside, apart = cv::Mat::zeros(both.size(), CV_8U);
  const int count = cv::connectedComponents(both, pieces, 8, CV_32S);
  cv::dilate(alone, beside, cv::Mat::ones(3, 3, CV_8U));
  std::vector<int> sizes(count, 0), touching(count, 0);
  for (int v = 0; v < both.rows; ++v) {
    for (int u = 0; u < both.cols; ++u) {
      const int piece = pieces.at<int>(v, u);
      ++sizes[piece], touching[piece] += beside.at<std::uint8_t>(v, u) != 0;
    }
  }
  for (int v = 0; v < both.rows; ++v) {
    for (int u = 0; u < both.cols; ++u) {
      const int piece = pieces.at<int>(v, u);
      if (piece > 0 && touching[piece] < kApart * sizes[piece]) apart.at<std::uint8_t>(v, u) = 255;
    }
  }
  return apart;
}

// CV_8SC1: the support plane that what is seen is nearest to, by less than `thin`; or kNoPlane.
cv::Mat nearestSupport(const cv::Mat& scenery, int supports, const std::vector<PlaneExtent>& planes,
                       float thin) {
  cv::Mat nearest(scenery.size(), CV_8S, cv::Scalar(kNoPlane));
  for (int v = 0; v < scenery.rows; ++v) {
    for (int u = 0; u < scenery.cols; ++u) {
      float least = thin;
      for (int k = 0; k < supports && scenery.at<float>(v, u) > 0.0f; ++k) {
        const float miss = planes[k].miss(scenery.at<float>(v, u), u, v);
        if (miss < least) least = miss, nearest.at<std::int8_t>(v, u) = static_cast<std::int8_t>(k);
      }
    }
  }
  return nearest;
}

void leaveLayers(const cv::Mat& scenery, int supports, const std::vector<PlaneExtent>& planes,
                 float thin, cv::Mat& seen) {
  const cv::Mat support = nearestSupport(scenery, supports, planes, thin);
  for (int j = supports; j < static_cast<int>(planes.size()); ++j) {
    const cv::Mat on_other = seen == j, near = on_other & (support != kNoPlane);
    if (cv::countNonZero(near) > 0) support.copyTo(seen, apartFrom(on_other & ~near, near));
  }
}

void leaveStrips(const cv::Mat& scenery, int supports, const std::vector<PlaneExtent>& planes,
                 cv::Mat& seen) {
  for (int k = 0; k < supports; ++k) {
    for (int j = supports; j < static_cast<int>(planes.size()); ++j) {
      const cv::Mat on_support = seen == k, both = crossing(scenery, planes[j], on_support);
      if (cv::countNonZero(both) > 0) seen.setTo(j, apartFrom(on_support & ~both, both));
    }
  }
}

}  // namespace

void settleCrossings(const cv::Mat& scenery, int supports, const std::vector<PlaneExtent>& planes,
                     float thin, cv::Mat& seen) {
  leaveLayers(scenery, supports, planes, thin, seen);
  leaveStrips(scenery, supports, planes, seen);
}

}  // namespace calipso::render

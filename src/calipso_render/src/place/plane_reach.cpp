#include "place/plane_reach.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "fill/distances_to.hpp"
#include "place/plane_outline.hpp"

namespace calipso::render {
namespace {

constexpr double kLeastPiece = 0.05;  // of a plane's pixels, for a connected piece of it to count
// of the side of a square as large as what is seen of a plane: so far it may go on beyond that,
constexpr double kBeyond = 0.25, kBeyondOutlined = 1.0;  // ... within its straight outlines,
constexpr double kBeyondAtLeast = 40.0;                  // and px
constexpr float kFarther = 0.97f;  // of a plane's nearness: where that is seen the plane is not

// Where a plane may be at most: in the hull of its larger pieces, and beyond by a part of its size.
cv::Mat reachOf(const cv::Mat& on, double part) {
  cv::Mat pieces, stats, centres, reach = cv::Mat::zeros(on.size(), CV_8U), beyond;
  cv::connectedComponentsWithStats(on, pieces, stats, centres, 8, CV_32S);
  const int all = cv::countNonZero(on);
  std::vector<cv::Point> points, hull;
  for (int v = 0; v < on.rows; ++v) {
    for (int u = 0; u < on.cols; ++u) {
      const int piece = pieces.at<int>(v, u);
      if (piece > 0 && stats.at<int>(piece, cv::CC_STAT_AREA) >= kLeastPiece * all)
        points.push_back({u, v});
    }
  }
  if (points.empty()) return reach;
  cv::convexHull(points, hull);
  cv::fillConvexPoly(reach, hull, 255);
  cv::distanceTransform(reach == 0, beyond, cv::DIST_L2, cv::DIST_MASK_5);
  return beyond <= std::max(kBeyondAtLeast, part * std::sqrt(static_cast<double>(all)));
}

}  // namespace

cv::Mat goesOn(const cv::Mat& plane, const cv::Mat& farthest, const cv::Mat& scenery,
               const cv::Mat& taken, const cv::Mat& beyond, const cv::Mat& edge,
               const cv::Mat& nothing) {
  const cv::Mat known = (scenery > 0.0f) & (plane > 0.0f),
                on = edge | (known & (scenery < (1.0f + kOnPlane) * plane) &
                             (scenery > (1.0f - kOnPlane) * farthest) & (taken == 0));
  cv::Mat absent = (known & (scenery < kFarther * farthest) & (beyond == 0)) | nothing;
  cv::morphologyEx(absent, absent, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
  if (cv::countNonZero(on) == 0) return cv::Mat::zeros(plane.size(), CV_8U);
  if (cv::countNonZero(absent) == 0) return reachOf(on, kBeyond) & (plane > 0.0f);
  const auto [to_on, to_absent] = distancesTo(on, absent);
  const cv::Mat within =
      withinOutlines(on, absent, to_on, to_absent, (scenery == 0.0f) & (nothing == 0));
  if (!within.empty()) return within & reachOf(on, kBeyondOutlined) & (plane > 0.0f);
  return (to_on < to_absent) & reachOf(on, kBeyond) & (plane > 0.0f);
}

}  // namespace calipso::render

#include "place/plane_edges.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

constexpr int kEdgeReach = 24;      // px around an edge that tell whether it stands out
constexpr float kOnEdge = 2.0f;     // px: too near to it to tell
constexpr float kAlongEdge = 1.0f;  // px
constexpr int kFewestAtEdge = 40;   // places on either side of it
constexpr int kClearEdge = 6;       // times as many places that say so as others

// px by which a place is off the line where two planes meet, towards where the first one is nearer.
float offEdge(const PicturePlane& a, const PicturePlane& b, int u, int v) {
  const Eigen::Vector3d d = a.abc - b.abc;
  return static_cast<float>(d.dot(Eigen::Vector3d(u, v, 1.0)) /
                            std::max(d.head<2>().norm(), 1e-12));
}

// What is seen around the line where two planes meet.
Meeting meetingOf(const PicturePlane& a, const PicturePlane& b, const cv::Mat& both,
                  const cv::Mat& seen, int index_a, int index_b) {
  int far[2] = {0, 0},
      near[2] = {0, 0};  // of a, of b: pixels that show it the farther one, the nearer one
  for (int v = 0; v < seen.rows; v += 2) {
    for (int u = 0; u < seen.cols; u += 2) {
      const int k = seen.at<std::int8_t>(v, u);
      if ((k != index_a && k != index_b) || both.at<std::uint8_t>(v, u) == 0) continue;
      const float off = offEdge(a, b, u, v);
      if (std::abs(off) < kOnEdge || std::abs(off) > kEdgeReach) continue;
      ++((off < 0.0f) == (k == index_a) ? far : near)[k == index_a ? 0 : 1];
    }
  }
  const auto clearly = [](const int(&these)[2], const int(&those)[2]) {
    return these[0] >= kFewestAtEdge && these[1] >= kFewestAtEdge &&
           these[0] + these[1] > kClearEdge * (those[0] + those[1]);
  };
  return clearly(far, near) ? kStandsOut : clearly(near, far) ? kCorner : kApart;
}

}  // namespace

Edges findEdges(const std::vector<PicturePlane>& planes, const cv::Mat& seen) {
  const int count = static_cast<int>(planes.size());
  std::vector<cv::Mat> around(count);
  for (int k = 0; k < count; ++k)
    cv::dilate(seen == k, around[k], cv::Mat::ones(2 * kEdgeReach + 1, 2 * kEdgeReach + 1, CV_8U));
  Edges edges(count, std::vector<Meeting>(count, kApart));
  for (int a = 0; a < count; ++a) {
    for (int b = a + 1; b < count; ++b)
      edges[a][b] = edges[b][a] =
          meetingOf(planes[a], planes[b], around[a] & around[b], seen, a, b);
  }
  return edges;
}

cv::Mat alongEdge(const PicturePlane& a, const PicturePlane& b, const cv::Size& size) {
  cv::Mat along = cv::Mat::zeros(size, CV_8U);
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      if (std::abs(offEdge(a, b, u, v)) <= kAlongEdge) along.at<std::uint8_t>(v, u) = 255;
    }
  }
  return along;
}

}  // namespace calipso::render

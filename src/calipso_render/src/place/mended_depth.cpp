#include "place/mended_depth.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>

#include "calipso_render/background.hpp"

namespace calipso::render {
namespace {

constexpr double kGap = 0.03;      // of the picture's width: radius of discs that fit into no gap
constexpr double kOnPlane = 0.03;  // of the nearness: measured ones spread
constexpr int kMeanSide = 5;       // px of a row whose mean tells how the depth runs,
constexpr int kReach = 5;          // and rows above and below over which it does
// parts of the depth by which it leaves the plane over them where it only passes through it
constexpr float kLeastChange = 0.012f, kChangePerRow = 0.0015f;

// CV_8UC1. @param nearness of a plane, 0: not there
cv::Mat isOn(const cv::Mat& nearness, const cv::Mat& depth) {
  return (nearness > 0.0f) & (cv::abs(1.0 / nearness - depth) < kOnPlane * depth);
}

// Where what is as near as a plane only passes through it, as a wall does that goes on below a
// table's far edge. CV_8UC1
// @param off part of the depth by which it is off the plane @param on CV_8UC1: by how little
cv::Mat passesThrough(const cv::Mat& off, const cv::Mat& on) {
  cv::Mat weight, mean, through = cv::Mat::zeros(on.size(), CV_8U);
  on.convertTo(weight, CV_32F, 1.0 / 255.0);
  cv::Mat counted = off.mul(weight);
  counted.setTo(0, on == 0);  // where the depth is unknown it is off by no number
  cv::blur(counted, mean, {kMeanSide, 1});
  cv::blur(weight, weight, {kMeanSide, 1});
  mean /= cv::max(weight, 1e-6);
  for (int v = 0; v < on.rows; ++v) {
    for (int u = 0; u < on.cols; ++u) {
      if (on.at<std::uint8_t>(v, u) == 0) continue;
      int first = v, last = v;
      while (first > std::max(0, v - kReach) && on.at<std::uint8_t>(first - 1, u) != 0) --first;
      while (last < std::min(on.rows - 1, v + kReach) && on.at<std::uint8_t>(last + 1, u) != 0)
        ++last;
      const float change = std::abs(mean.at<float>(last, u) - mean.at<float>(first, u));
      if (change > std::max(kLeastChange, kChangePerRow * static_cast<float>(last - first)))
        through.at<std::uint8_t>(v, u) = 255;
    }
  }
  return through;
}

// The connected pieces of a mask around a third of whose rim the plane is seen: what lies between the
// members of a lattice that stands on it may be far behind.
cv::Mat piecesAmong(const cv::Mat& plane, const cv::Mat& mask) {
  cv::Mat pieces, found(mask.size(), CV_8U);
  std::vector<int> rim(cv::connectedComponents(mask, pieces, 4, CV_32S), 0), on_plane = rim;
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) {
      const int piece = pieces.at<int>(v, u);
      if (piece == 0) continue;
      for (const cv::Point& q : {cv::Point(u - 1, v), {u + 1, v}, {u, v - 1}, {u, v + 1}}) {
        if (!cv::Rect({0, 0}, mask.size()).contains(q) || pieces.at<int>(q) == piece) continue;
        ++rim[piece], on_plane[piece] += plane.at<std::uint8_t>(q) != 0 ? 1 : 0;
      }
    }
  }
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) {
      const int piece = pieces.at<int>(v, u);
      found.at<std::uint8_t>(v, u) = piece != 0 && 3 * on_plane[piece] >= rim[piece] ? 255 : 0;
    }
  }
  return found;
}

}  // namespace

cv::Mat mendedDepth(const cv::Mat& depth, const cv::Mat& labels,
                    const std::vector<SupportPlane>& planes, const Camera& camera) {
  const cv::Mat ground = depth.empty() ? cv::Mat() : groundNearness(planes, camera, cv::Mat());
  if (ground.empty()) return depth;
  cv::Mat plane_depth = 1.0 / ground;
  plane_depth.setTo(0.0f, ground == 0.0f);
  const cv::Mat on = isOn(ground, depth);
  cv::Mat gap =
      (plane_depth > 0.0f) & (labels == 0) & ~on & ((depth == 0.0f) | (depth > plane_depth));
  for (const SupportPlane& plane : planes) {  // is seen past another's edge
    const cv::Mat own = groundNearness({plane}, camera, cv::Mat());
    if (!own.empty()) gap.setTo(0, isOn(own, depth));
  }
  if (cv::countNonZero(gap) == 0) return depth;
  const cv::Mat seen = on & ~passesThrough((depth - plane_depth) / depth, on);
  const int radius = cvRound(kGap * depth.cols);
  cv::Mat closed;
  cv::copyMakeBorder(seen | (labels != 0), closed, radius, radius, radius, radius,
                     cv::BORDER_CONSTANT);
  cv::morphologyEx(closed, closed, cv::MORPH_CLOSE,
                   cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1}));
  cv::Mat mended = depth.clone();
  gap &= closed(cv::Rect({radius, radius}, depth.size()));
  plane_depth.copyTo(mended, piecesAmong(seen, gap));
  return mended;
}

}  // namespace calipso::render

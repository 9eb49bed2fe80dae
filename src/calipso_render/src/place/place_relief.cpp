#include "place/place_relief.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace calipso::render {
namespace {

constexpr float kLeastSlope = 0.05f;  // cosine between normal and sun of what is lit
constexpr float kOther = 1.05f;       // times as near as relief beside it: another part of it

// Of the pixels beside one that are set in a mask the one about as near as `nearness`.
std::optional<cv::Point> nearestBeside(const cv::Mat& scenery, const cv::Mat& mask, float nearness,
                                       const cv::Point& at) {
  const cv::Rect around = cv::Rect(at.x - 1, at.y - 1, 3, 3) & cv::Rect({0, 0}, mask.size());
  std::optional<cv::Point> best;
  float least = 1e9f;
  for (int v = around.y; v < around.br().y; ++v) {
    for (int u = around.x; u < around.br().x; ++u) {
      const float off = std::abs(scenery.at<float>(v, u) - nearness);
      if (mask.at<std::uint8_t>(v, u) != 0 && off < least) least = off, best = cv::Point(u, v);
    }
  }
  return best;
}

}  // namespace

cv::Mat PlaceSurfaces::sureOffSupports() const {
  cv::Mat off = sure.clone();
  if (!off.empty()) off.setTo(0, (label >= 1) & (label <= supports));
  return off;
}

Relief findRelief(const PlaceSurfaces& surfaces, const Eigen::Vector3f& sun) {
  if (surfaces.empty()) return {};
  Relief relief;
  relief.seen = surfaces.label > surfaces.supports, relief.position = surfaces.position,
  relief.normal = surfaces.normal;
  relief.wall = surfaces.label - surfaces.supports;  // less than none is none
  relief.wall.setTo(0, surfaces.label == PlaceSurfaces::kCurved);
  relief.seen.setTo(0, turnedAway(relief, sun) & (relief.wall == 0));
  relief.index();
  return relief.box.isEmpty() ? Relief() : relief;
}

void addRims(const cv::Mat& scenery, const cv::Mat& depth, Relief& relief) {
  if (relief.empty()) return;
  const cv::Mat inner = relief.seen.clone();
  for (int v = 0; v < inner.rows; ++v) {
    for (int u = 0; u < inner.cols; ++u) {
      const float behind = scenery.at<float>(v, u), away = depth.at<float>(v, u);
      if (behind == 0.0f || away == 0.0f) continue;
      const auto beside = nearestBeside(scenery, inner, 1.0f / away, {u, v});
      if (!beside) continue;
      const float own = scenery.at<float>(*beside), off = std::abs(1.0f / away - own);
      const bool same = inner.at<std::uint8_t>(v, u) != 0 && own < kOther * behind;
      if (same || off >= std::abs(1.0f / away - behind)) continue;
      relief.seen.at<std::uint8_t>(v, u) = 255;
      relief.position.at<cv::Vec3f>(v, u) = relief.position.at<cv::Vec3f>(*beside);
      relief.normal.at<cv::Vec3f>(v, u) = relief.normal.at<cv::Vec3f>(*beside);
      relief.wall.at<std::uint8_t>(v, u) = relief.wall.at<std::uint8_t>(*beside);
    }
  }
  relief.index();
}

cv::Mat turnedAway(const Relief& relief, const Eigen::Vector3f& sun) {
  cv::Mat away = cv::Mat::zeros(relief.seen.size(), CV_8U);
  for (int v = 0; v < away.rows; ++v) {
    for (int u = 0; u < away.cols; ++u) {
      if (relief.at(u, v) && relief.receiver(u, v).normal.dot(sun) < kLeastSlope)
        away.at<std::uint8_t>(v, u) = 255;
    }
  }
  return away;
}

}  // namespace calipso::render

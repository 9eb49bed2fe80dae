#include "place/place_relief.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr float kLeastSlope = 0.05f;  // cosine between normal and sun of what is lit
constexpr float kFullShade = 0.15f;   // of the sun
constexpr std::size_t kFewest = 50;   // px
constexpr float kDark = 0.01f;        // linear
constexpr float kOther = 1.05f;       // times as near as relief beside it: another part of it
constexpr float kNoShade = 0.9f;      // hardly darker: the shade was not where it was predicted

float brightness(const cv::Vec3f& code) {
  return luminance(
      {linearFromRealCode(code[0]), linearFromRealCode(code[1]), linearFromRealCode(code[2])});
}

// Sun over ambient light that a surface facing so gets.
float sunShare(const Light& light, const Eigen::Vector3f& normal) {
  const float shaded = luminance(diffuseShading(light, normal, 0.0f)),
              lit = luminance(diffuseShading(light, normal, 1.0f));
  return (lit - shaded) / std::max(shaded, 1e-4f);
}

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

void findUmbra(const Light& light, const cv::Mat& picture, const cv::Mat& plate, const cv::Mat& sun,
               const cv::Mat& labels, const std::vector<SupportPlane>& planes,
               const cv::Vec3f& umbra, Relief& relief) {
  if (relief.empty()) return;
  relief.umbra = cv::Mat(relief.seen.size(), CV_32F, cv::Scalar(1.0f));
  const float own = luminance(umbra),
              of_planes = sunShare(
                  light, planes.empty() ? Eigen::Vector3f::UnitZ()
                                        : Eigen::Vector3f(planes.front().normal.cast<float>()));
  std::vector<float> scales;  // of the sun's share, seen over predicted
  for (int v = 0; v < relief.seen.rows; ++v) {
    for (int u = 0; u < relief.seen.cols; ++u) {
      if (!relief.at(u, v)) continue;
      const Eigen::Vector3f normal = relief.receiver(u, v).normal;
      const float share = sunShare(light, normal), lit = brightness(plate.at<cv::Vec3f>(v, u));
      relief.umbra.at<float>(v, u) = share;
      if (sun.at<float>(v, u) > kFullShade || labels.at<std::uint8_t>(v, u) != 0 || lit < kDark)
        continue;
      const float ratio = brightness(picture.at<cv::Vec3f>(v, u)) / lit;
      scales.push_back((1.0f / std::clamp(ratio, 0.05f, 1.0f) - 1.0f) / share);
    }
  }
  float scale = of_planes > 0.0f ? (1.0f / own - 1.0f) / of_planes : 1.0f;
  if (scales.size() >= kFewest) {
    std::nth_element(scales.begin(), scales.begin() + scales.size() / 2, scales.end());
    const float seen = scales[scales.size() / 2];
    if (seen > 1.0f / kNoShade - 1.0f) scale = seen;
  }
  for (int v = 0; v < relief.seen.rows; ++v) {
    float* row = relief.umbra.ptr<float>(v);
    for (int u = 0; u < relief.seen.cols; ++u) row[u] = 1.0f / (1.0f + scale * row[u]);
  }
}

}  // namespace calipso::render

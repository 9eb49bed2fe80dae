#include "frame/shade_reach.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

constexpr int kStride = 4;             // px between the places that are looked at
constexpr float kNear = 2.0f;          // radii from a ball's centre: it hides a quarter of the sky
constexpr float kAboutFitted = 0.26f;  // rad, 15 degrees: by how much a confirmed sun may be off
constexpr float kFromZenith = 1.22f;   // rad, 70 degrees: how low one may stand that was not seen

bool reaches(const Ball& ball, const std::vector<SunRange>& sun, const Eigen::Vector3f& place) {
  const Eigen::Vector3f way = ball.centre - place;
  const float distance = way.norm();
  if (distance < kNear * ball.radius) return true;
  const float half = std::asin(ball.radius / distance);
  return std::any_of(sun.begin(), sun.end(), [&](const SunRange& range) {
    return std::acos(std::clamp(way.dot(range.axis) / distance, -1.0f, 1.0f)) < range.angle + half;
  });
}

}  // namespace

std::vector<SunRange> sunRanges(const Eigen::Vector3f& to_sun, bool confirmed,
                                const Eigen::Vector3f& up) {
  std::vector<SunRange> ranges = {{to_sun, kAboutFitted}};
  if (!confirmed) ranges.push_back({up, kFromZenith});
  return ranges;
}

Ball ballAround(const Points& vertices) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : vertices) box.extend(p);
  Ball ball{box.center(), 0.0f};
  for (const Eigen::Vector3f& p : vertices)
    ball.radius = std::max(ball.radius, (p - ball.centre).norm());
  return ball;
}

cv::Mat shadeReach(const std::vector<Ball>& balls, const std::vector<SunRange>& sun,
                   const PlaceView& place, const cv::Size& size) {
  cv::Mat reach = cv::Mat::zeros(size, CV_8U);
#pragma omp parallel for schedule(dynamic, 4)
  for (int v = 0; v < size.height; v += kStride) {
    for (int u = 0; u < size.width; u += kStride) {
      Receiver receiver;
      if (!place.at(static_cast<float>(u), static_cast<float>(v), receiver)) continue;
      const bool any = std::any_of(balls.begin(), balls.end(), [&](const Ball& ball) {
        return reaches(ball, sun, receiver.position);
      });
      if (any) reach(cv::Rect(u, v, kStride, kStride) & cv::Rect({0, 0}, size)).setTo(255);
    }
  }
  return reach;
}

cv::Mat reachOfPassing(const StagedFrame& frame, const PlaceView& place) {
  const Prepared& prepared = frame.prepared;
  std::vector<Ball> balls;
  for (std::size_t i = 0; i < frame.edited.size(); ++i) {
    if (!frame.casts(i) || !prepared.moves[i] || !prepared.surfaces[i].in_video) continue;
    const auto& vertices = frame.observed[i];
    if (!vertices) return {};
    balls.push_back(ballAround(*vertices));
  }
  const auto sun = sunRanges(prepared.light.light.direction, prepared.light.confirmed(),
                             frame.params.up.cast<float>());
  return shadeReach(balls, sun, place, frame.labels.size());
}

}  // namespace calipso::render

#include "turntable.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace calipso::render {
namespace {

constexpr int kViews = 8;
constexpr int kMargin = 12;        // px around the object
constexpr float kTooLarge = 0.5f;  // of the distance: an extent at which nothing is turned
constexpr double kSide = 360.0;    // px of a view's longer side, no more

std::size_t largest(const Prepared& prepared) {
  const auto pixels = [&](const auto& surface) {
    return cv::countNonZero(prepared.key_labels == surface.index);
  };
  return std::max_element(prepared.surfaces.begin(), prepared.surfaces.end(),
                          [&](const auto& a, const auto& b) { return pixels(a) < pixels(b); }) -
         prepared.surfaces.begin();
}

}  // namespace

cv::Mat turntable(const std::shared_ptr<const Prepared>& prepared, RenderParams params,
                  const FrameInput& key_frame) {
  const std::size_t object = largest(*prepared);
  const Points rest = key_frame.objects[object].vertices;
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& x : rest) box.extend(x);
  const Eigen::Vector3f middle = box.center();
  const Camera& camera = key_frame.camera;
  const float distance = (middle - camera.world_from_camera.translation().cast<float>()).norm();
  if (box.diagonal().norm() > kTooLarge * distance) return {};
  params.quality = Quality::kFinal;
  Renderer renderer(prepared, params);
  std::vector<cv::Mat> pictures;
  std::vector<cv::Point> covered;
  for (int i = 0; i < kViews; ++i) {
    FrameInput in = key_frame;
    in.objects[object].edited = true;
    const Eigen::AngleAxisf turn(static_cast<float>(2.0 * M_PI * i / kViews),
                                 params.up.cast<float>());
    for (Eigen::Vector3f& x : in.objects[object].vertices) {
      x = middle + turn * (x - middle);
      const Eigen::Vector2d q = camera.projectWorld(x.cast<double>());
      covered.emplace_back(cvRound(q.x()), cvRound(q.y()));
    }
    pictures.push_back(renderer.composite(in).bgr);
  }
  const cv::Rect seen = cv::boundingRect(covered);
  const cv::Rect place = (seen + cv::Size(2 * kMargin, 2 * kMargin) - cv::Point(kMargin, kMargin)) &
                         cv::Rect({0, 0}, key_frame.bgr.size());
  if (place.empty()) return {};
  cv::Mat all;
  for (cv::Mat& picture : pictures) picture = picture(place);
  cv::hconcat(pictures, all);
  const double scale = kSide / std::max(place.width, place.height);
  cv::resize(all, all, {}, scale, scale, scale < 1.0 ? cv::INTER_AREA : cv::INTER_CUBIC);
  return all;
}

}  // namespace calipso::render

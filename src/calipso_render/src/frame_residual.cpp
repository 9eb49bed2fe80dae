// The part of FrameCompositor that carries over what drawing misses: the video's pixels around an object at rest, less
// the same pixels drawn, move along with it. Unmoved, the drawn object is the video again, grain and all.

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "frame_compositor.hpp"
#include "view_warp.hpp"

namespace calipso::render {
namespace {

constexpr float kWholePx = 0.5f, kNonePx = 5.0f;  // movement up to which the residual goes along, and from which none does
constexpr int kReach = 5;  // px beyond the silhouette

}  // namespace

// The objects in question drawn where the video has them, from what was prepared alone.
cv::Mat FrameCompositor::restPicture(const Prepared& prepared, const RenderParams& params, const std::vector<bool>& edited) {
  FrameInput input;
  prepared.background.plate.convertTo(input.bgr, CV_8U);
  input.labels = prepared.key_labels;
  input.camera = prepared.camera;
  for (std::size_t i = 0; i < edited.size(); ++i) {
    if (!edited[i]) continue;
    ObjectInFrame o;
    o.name = prepared.surfaces[i].name, o.edited = true, o.vertices = prepared.surfaces[i].key_vertices;
    input.objects.push_back(o);
  }
  RenderParams plain = params;
  plain.add_noise = plain.keep_still = plain.carry_residual = false;
  ShadowCache light;
  RestPicture none;
  FrameCompositor compositor(prepared, plain, input, light, none);
  cv::Mat picture(input.bgr.size(), CV_32FC3, cv::Scalar::all(-1));
  compositor.prepareFrame();
  const cv::Rect& r = compositor.region_;
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = r.y; v < r.y + r.height; ++v) {
    for (int u = r.x; u < r.x + r.width; ++u) {
      if (compositor.removed_.at<std::uint8_t>(v - r.y, u - r.x) != 0) picture.at<cv::Vec3f>(v, u) = compositor.composedAt(u, v).colour;
    }
  }
  return picture;
}

void FrameCompositor::findResidual() {
  if (!params_.carry_residual || !sameView(frame_.camera, prepared_.camera)) return;
  const auto seen = [](const ScreenMesh& m) { return !m.points.empty(); };
  if (std::none_of(observed_.begin(), observed_.end(), seen)) return;
  std::vector<bool> resting(edited_.size());
  for (std::size_t i = 0; i < edited_.size(); ++i) resting[i] = edited_[i] && at_rest_[i];
  if (rest_.edited != resting) rest_ = {resting, restPicture(prepared_, params_, resting)};
  findOwners(resting);
  // Where each drawn pixel's surface is seen in the video, and beyond the silhouette the nearest one's.
  cv::Mat shift(region_.size(), CV_32FC2, cv::Scalar::all(0)), uncovered(region_.size(), CV_8U, cv::Scalar(255));
  cv::Mat owner(region_.size(), CV_16S, cv::Scalar(-1));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    for (int u = 0; u < region_.width; ++u) {
      const std::uint32_t id = centre_->ids(v)[u];
      if (id == VisibilityBuffer::kNothing) continue;
      const int slot = VisibilityBuffer::objectOf(id);
      if (observed_[slot].points.empty()) continue;
      const Eigen::Vector2f moved = movement(id, static_cast<float>(u + region_.x), static_cast<float>(v + region_.y));
      shift.at<cv::Vec2f>(v, u) = {moved.x(), moved.y()};
      uncovered.at<std::uint8_t>(v, u) = 0;
      owner.at<short>(v, u) = static_cast<short>(surface_of_slot_[slot]);
    }
  }
  if (cv::countNonZero(uncovered) == static_cast<int>(uncovered.total())) return;
  cv::Mat distance, nearest;
  cv::distanceTransform(uncovered, distance, nearest, cv::DIST_L2, cv::DIST_MASK_5, cv::DIST_LABEL_PIXEL);
  std::vector<cv::Point> place(1);
  for (int v = 0; v < region_.height; ++v) {
    for (int u = 0; u < region_.width; ++u) {
      if (uncovered.at<std::uint8_t>(v, u) != 0) continue;
      const std::size_t label = static_cast<std::size_t>(nearest.at<int>(v, u));
      if (place.size() <= label) place.resize(label + 1);
      place[label] = {u, v};
    }
  }
  residual_ = cv::Mat(region_.size(), CV_32FC4, cv::Scalar::all(0));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    for (int u = 0; u < region_.width; ++u) {
      if (distance.at<float>(v, u) > kReach) continue;
      const cv::Point from = place[nearest.at<int>(v, u)];
      const cv::Vec2f& d = shift.at<cv::Vec2f>(from);
      const float part = 1.0f - smoothStep(kWholePx, kNonePx, std::hypot(d[0], d[1]));
      if (part > 0.0f) residual_.at<cv::Vec4f>(v, u) = residualAt(u + region_.x - d[0], v + region_.y - d[1], owner.at<short>(from)) * part;
    }
  }
}

// Which resting object's surroundings a pixel of the video belongs to: the nearest one's.
void FrameCompositor::findOwners(const std::vector<bool>& resting) {
  owners_ = cv::Mat(region_.size(), CV_16S, cv::Scalar(-1));
  cv::Mat least(region_.size(), CV_32F, cv::Scalar(1e9f)), distance;
  for (std::size_t i = 0; i < resting.size(); ++i) {
    if (!edited_[i]) continue;
    cv::distanceTransform(originalOf(static_cast<int>(i)) == 0, distance, cv::DIST_L2, cv::DIST_MASK_5);
    const cv::Mat nearer = distance < least;
    owners_.setTo(static_cast<short>(i), nearer);
    distance.copyTo(least, nearer);
  }
}

// Residual of the video at a place of the picture, linear light, and 1 as the fourth value; 0 where there is none.
cv::Vec4f FrameCompositor::residualAt(float u, float v, int owner) const {
  const float fu = std::floor(u), fv = std::floor(v), x = u - fu, y = v - fv;
  cv::Vec4f sum;
  for (int k = 0; k < 4; ++k) {
    const float weight = ((k & 1) != 0 ? x : 1.0f - x) * ((k & 2) != 0 ? y : 1.0f - y);
    const cv::Point at(static_cast<int>(fu) + (k & 1), static_cast<int>(fv) + (k >> 1));
    if (weight == 0.0f || !region_.contains(at)) continue;
    const cv::Vec3f& drawn = rest_.picture.at<cv::Vec3f>(at);
    if (drawn[0] < 0.0f || owners_.at<short>(at - region_.tl()) != owner) continue;
    const cv::Vec3b& code = frame_.bgr.at<cv::Vec3b>(at);
    for (int c = 0; c < 3; ++c) sum[c] += weight * (linearFromCode(code[c]) - drawn[c]);
    sum[3] += weight;
  }
  return sum;
}

}  // namespace calipso::render

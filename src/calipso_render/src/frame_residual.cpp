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

constexpr float kDark = 1e-5f;  // linear; a plate darker than that says nothing of its shadow

// For every pixel the nearest one of a set.
struct Nearest {
  cv::Mat labels;
  std::vector<cv::Point> place;  // per label; empty: the set is empty
  cv::Point at(int v, int u) const { return place[labels.at<int>(v, u)]; }
};

Nearest nearestWhere(const cv::Mat& set) {
  Nearest nearest;
  if (cv::countNonZero(set) == 0) return nearest;
  cv::Mat distance;
  cv::distanceTransform(set == 0, distance, nearest.labels, cv::DIST_L2, cv::DIST_MASK_5, cv::DIST_LABEL_PIXEL);
  for (int v = 0; v < set.rows; ++v) {
    for (int u = 0; u < set.cols; ++u) {
      if (set.at<std::uint8_t>(v, u) == 0) continue;
      const std::size_t label = static_cast<std::size_t>(nearest.labels.at<int>(v, u));
      if (nearest.place.size() <= label) nearest.place.resize(label + 1);
      nearest.place[label] = {u, v};
    }
  }
  return nearest;
}

}  // namespace

// The objects in question drawn where the video has them, from what was prepared alone.
RestPicture FrameCompositor::restPicture(const Prepared& prepared, const RenderParams& params, const std::vector<bool>& edited) {
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
  ShadowCache shadows;
  RestPicture none;
  FrameCompositor rest(prepared, plain, input, shadows, none);
  rest.prepareFrame();
  const cv::Rect& r = rest.region_;
  RestPicture picture{edited, cv::Mat(input.bgr.size(), CV_32FC3, cv::Scalar::all(-1)), cv::Mat::zeros(input.bgr.size(), CV_32FC3),
                      cv::Mat(input.bgr.size(), CV_16S, cv::Scalar(-1))};
  if (r.empty()) return picture;
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = r.y; v < r.y + r.height; ++v) {
    for (int u = r.x; u < r.x + r.width; ++u) {
      if (rest.removed_.at<std::uint8_t>(v - r.y, u - r.x) == 0) continue;
      const Drawn drawn = rest.drawnAt(u, v);
      const cv::Vec3f behind = rest.behindAt(u, v).colour, revealed = rest.revealedAt(u, v).colour;
      picture.drawn.at<cv::Vec3f>(v, u) = drawn.cover * drawn.colour;
      for (int c = 0; c < 3; ++c) picture.passing.at<cv::Vec3f>(v, u)[c] = (1.0f - drawn.cover) * (revealed[c] > kDark ? behind[c] / revealed[c] : 1.0f);
    }
  }
  cv::Mat owners(r.size(), CV_16S, cv::Scalar(-1));
  for (int v = 0; v < r.height; ++v) {
    for (int u = 0; u < r.width; ++u) {
      const std::uint32_t id = rest.centre_->ids(v)[u];
      if (id != VisibilityBuffer::kNothing) owners.at<short>(v, u) = static_cast<short>(rest.surface_of_slot_[VisibilityBuffer::objectOf(id)]);
    }
  }
  const Nearest nearest = nearestWhere(owners >= 0);
  if (nearest.place.empty()) return picture;
  cv::Mat out = picture.owners(r);
  for (int v = 0; v < r.height; ++v) {
    for (int u = 0; u < r.width; ++u) out.at<short>(v, u) = owners.at<short>(nearest.at(v, u));
  }
  return picture;
}

void FrameCompositor::findResidual() {
  if (!params_.carry_residual || !sameView(frame_.camera, prepared_.camera)) return;
  const auto seen = [](const ScreenMesh& m) { return !m.points.empty(); };
  if (std::none_of(observed_.begin(), observed_.end(), seen)) return;
  std::vector<bool> resting(edited_.size());
  for (std::size_t i = 0; i < edited_.size(); ++i) resting[i] = edited_[i] && at_rest_[i];
  if (rest_.edited != resting) rest_ = restPicture(prepared_, params_, resting);
  // Where each drawn pixel's surface is seen in the video, and beyond the silhouette the nearest one's.
  // What the model lacks, within the mask however far, goes along too.
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
  const Nearest nearest = nearestWhere(uncovered == 0);
  if (nearest.place.empty()) return;
  residual_ = cv::Mat(region_.size(), CV_32FC4, cv::Scalar::all(0));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    for (int u = 0; u < region_.width; ++u) {
      const cv::Point from = nearest.at(v, u);
      const cv::Vec2f& d = shift.at<cv::Vec2f>(from);
      const float part = 1.0f - smoothStep(kWholePx, kNonePx, std::hypot(d[0], d[1]));
      if (part > 0.0f) residual_.at<cv::Vec4f>(v, u) = residualAt(u + region_.x - d[0], v + region_.y - d[1], owner.at<short>(from)) * part;
    }
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
    cv::Vec3f drawn = rest_.drawn.at<cv::Vec3f>(at);
    if (drawn[0] < 0.0f || rest_.owners.at<short>(at) != owner) continue;
    drawn += rest_.passing.at<cv::Vec3f>(at).mul(revealedAt(at.x, at.y).colour);
    const cv::Vec3b& code = frame_.bgr.at<cv::Vec3b>(at);
    for (int c = 0; c < 3; ++c) sum[c] += weight * (linearFromCode(code[c]) - drawn[c]);
    sum[3] += weight;
  }
  return sum;
}

}  // namespace calipso::render

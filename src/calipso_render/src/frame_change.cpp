// The part of FrameCompositor that tells what an edit changes: light on the support planes, and what stays.

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "frame_compositor.hpp"

namespace calipso::render {
namespace {

constexpr float kSameRatio = 0.01f, kPlateRatio = 0.06f;  // change of light from which the plate is taken, and only it
constexpr int kRimReach = 4;  // mask margins around a surface at rest in which the frame's pixels stay

}  // namespace

void FrameCompositor::measureSun() {
  sun_now_ = cv::Mat(region_.size(), CV_32F, cv::Scalar(-1.0f));
  sun_before_ = sun_now_.clone();
  shaded_ = cv::Mat::zeros(region_.size(), CV_32F);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    for (int u = 0; u < region_.width; ++u) {
      const auto r = receiverAt(params_.planes, frame_.camera, region_.x + u, region_.y + v);
      if (!r) continue;
      const float others = shadows_.others->visibility(r->position, r->normal);
      const float original = shadows_.originals->visibility(r->position, r->normal);
      sun_now_.at<float>(v, u) = others * moved_shadow_->visibility(r->position, r->normal);
      sun_before_.at<float>(v, u) = others * original;
      const float kept = luminance(shadowRatio(original, sky_before_.at<float>(v, u)));
      shaded_.at<float>(v, u) = smoothStep(kSameRatio, kPlateRatio, 1.0f - kept);
    }
  }
}

// Where the original's shadow changes, it goes with its whole edge: a predicted shadow is off by some
// pixels, so what lies that near to both the shadow and the change is taken from the plate.
void FrameCompositor::findRelit() {
  cv::Mat change = cv::Mat::zeros(region_.size(), CV_32F), shaded;
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    for (int u = 0; u < region_.width; ++u) {
      if (sun_now_.at<float>(v, u) < 0.0f) continue;
      const float now = luminance(shadowRatio(sun_now_.at<float>(v, u), sky_now_.at<float>(v, u)));
      const float before = luminance(shadowRatio(sun_before_.at<float>(v, u), sky_before_.at<float>(v, u)));
      change.at<float>(v, u) = smoothStep(kSameRatio, kPlateRatio, std::abs(now - before));
    }
  }
  const cv::Mat reach = disc(params_.background.shadow_margin_px);
  cv::dilate(change, change, reach);
  cv::dilate(shaded_, shaded, reach);
  cv::blur(cv::min(change, shaded), relit_, {3, 3});
}

// The rim of an original's pixels belongs to the surface beside it, not to another edited object's.
void FrameCompositor::keepRims(const cv::Mat& owner) {
  cv::Mat rims = cv::Mat::zeros(region_.size(), CV_32F);
  const int margin = params_.background.mask_margin_px, side = 2 * kRimReach * margin + 1;
  for (std::size_t i = 0; i < edited_.size(); ++i) {
    if (!edited_[i]) continue;
    cv::Mat rim = cv::Mat::zeros(region_.size(), CV_32F), foreign = cv::Mat::zeros(region_.size(), CV_8U);
    still_.copyTo(rim, owner == static_cast<int>(i));
    cv::dilate(rim, rim, cv::Mat::ones(side, side, CV_8U));
    for (std::size_t j = 0; j < edited_.size(); ++j) {
      if (edited_[j] && j != i) foreign |= originalOf(static_cast<int>(j));
    }
    cv::dilate(foreign, foreign, disc(margin));
    cv::Mat own;
    cv::dilate(originalOf(static_cast<int>(i)), own, disc(margin));
    foreign.setTo(0, own);
    rim.setTo(0.0f, foreign);
    rims = cv::max(rims, rim);
  }
  rims.copyTo(still_, owner < 0);
}

void FrameCompositor::findStill() {
  still_ = cv::Mat::zeros(region_.size(), CV_32F);
  if (!params_.keep_still) return;
  cv::Mat owner(region_.size(), CV_16S, cv::Scalar(-1));  // edited surface seen there
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region_.height; ++v) {
    for (int u = 0; u < region_.width; ++u) {
      const std::uint32_t id = centre_->ids(v)[u];
      if (id == VisibilityBuffer::kNothing || !edited_[surface_of_slot_[VisibilityBuffer::objectOf(id)]]) continue;
      owner.at<short>(v, u) = static_cast<short>(surface_of_slot_[VisibilityBuffer::objectOf(id)]);
      still_.at<float>(v, u) = stillness(id, u + region_.x, v + region_.y);
    }
  }
  keepRims(owner);
}

}  // namespace calipso::render

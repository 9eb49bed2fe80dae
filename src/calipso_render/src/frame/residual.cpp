#include "frame/residual.hpp"

#include <algorithm>
#include <cmath>

#include "calipso_render/colour.hpp"
#include "frame/mask_morphology.hpp"
#include "frame/removed.hpp"
#include "frame/still_pixels.hpp"
#include "frame/surface_sun.hpp"
#include "smooth_step.hpp"

namespace calipso::render {
namespace {

constexpr float kWholePx = 0.5f;  // movement up to which the residual goes along

// ... of what sways in the video: what is missed is how it did
constexpr float kWholeSwaying = 0.05f, kNoneSwaying = 0.3f;

// factor: what is missed by more, where a surface has moved, is misfit and not its look
constexpr float kMostChange = 3.0f;

// px around surfaces at rest in which their rims and what they take over lie
constexpr int kCarried = 16;

constexpr float kDark = 1e-5f;  // linear: the least luminance that is divided by

}  // namespace

Residual::Residual(const StagedFrame& frame, const RevealedPlace& revealed,
                   const VisibilityBuffer& centre, const RestPicture& rest)
    : frame_(frame), revealed_(revealed), centre_(centre), rest_(rest), region_(centre.region()) {
  const cv::Rect carried = carriedBox();
  if (carried.empty()) return;
  findMiss(carried);
  findRims(carried);
}

// Pixels that take something over: those of triangles with a point that moved little, and their
// surroundings.
cv::Rect Residual::carriedBox() const {
  cv::Rect carried;
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot) {
    if (!frame_.objects[slot].isAtRestInVideo()) continue;
    const Points &now = frame_.objects[slot].actor.screen.points,
                 &then = frame_.objects[slot].observed.points;
    const Triangles& triangles = frame_.objects[slot].actor.surface->triangles;
    float left = 1e9f, top = 1e9f, right = -1e9f, bottom = -1e9f;
#pragma omp parallel for schedule(static) reduction(min : left, top) reduction(max : right, bottom)
    for (std::size_t k = 0; k < triangles.size(); ++k) {
      if (!mayMoveLess(now, then, triangles[k], kNonePx)) continue;
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector3f& p = now[triangles[k][i]];
        left = std::min(left, p.x()), right = std::max(right, p.x());
        top = std::min(top, p.y()), bottom = std::max(bottom, p.y());
      }
    }
    if (!(left <= right && top <= bottom)) continue;
    const auto pixel = [](float x) { return static_cast<int>(std::clamp(x, -1.0f, 1e6f)); };
    carried |= cv::Rect(cv::Point(pixel(left) - kCarried, pixel(top) - kCarried),
                        cv::Point(pixel(right) + kCarried + 1, pixel(bottom) + kCarried + 1));
  }
  return carried & region_;
}

// @param carried pixels that may take over what is missed
void Residual::findMiss(const cv::Rect& carried) {
  miss_box_ = grown(carried, kCarried) & rest_.box;
  const cv::Rect box = miss_box_;
  if (box.empty()) return;
  miss_ = cv::Mat(box.size(), CV_32FC4);
  const cv::Mat foreign =
      shownOfMoved(frame_, rest_.owners(box), box) | shownInPassing(frame_, box, kMixed);
#pragma omp parallel for schedule(static)
  for (int j = 0; j < box.height; ++j) {
    const int v = box.y + j;
    const cv::Vec3b* codes = frame_.input.bgr.ptr<cv::Vec3b>(v) + box.x;
    const cv::Vec3f *drawn = rest_.drawn.ptr<cv::Vec3f>(v) + box.x,
                    *passing = rest_.passing.ptr<cv::Vec3f>(v) + box.x;
    cv::Vec4f* miss = miss_.ptr<cv::Vec4f>(j);
    for (int i = 0; i < box.width; ++i) {
      if (passing[i][0] < 0.0f || frame_.isElsewhere(box.x + i, v) ||
          foreign.at<std::uint8_t>(j, i) != 0) {
        miss[i] = {};
        continue;
      }
      cv::Vec3f expected = drawn[i];
      if (passing[i] != cv::Vec3f()) expected += passing[i].mul(revealed_.at(box.x + i, v).colour);
      for (int c = 0; c < 3; ++c) expected[c] = std::max(0.0f, expected[c]);
      miss[i] = {linearFromCode(codes[i][0]) - expected[0],
                 linearFromCode(codes[i][1]) - expected[1],
                 linearFromCode(codes[i][2]) - expected[2], 1.0f};
    }
  }
}

// Pixels that no surface at rest is drawn in, but to which its rim may have come, each with the
// nearest drawn one: carried from neighbour to neighbour, down and up again (Danielsson 1980).
void Residual::findRims(const cv::Rect& carried) {
  const cv::Rect box = carried - region_.tl();
  const auto isDrawnAtRest = [&](std::uint32_t id) {
    return id != VisibilityBuffer::kNothing && frame_.objectOf(id).isAtRestInVideo();
  };
  const auto isDrawn = [&](std::uint32_t id) {
    return id != VisibilityBuffer::kNothing && frame_.objectOf(id).edited;
  };
  cv::Mat index(region_.size(), CV_32S, cv::Scalar(-1));
  for (int v = 0; v < region_.height; ++v) {
    rim_rows_.push_back(rims_.size());
    const std::uint32_t* ids = centre_.ids(v);
    const std::uint8_t* reach = rest_.reach.ptr<std::uint8_t>(v + region_.y) + region_.x;
    for (int u = box.x; v >= box.y && v < box.br().y && u < box.br().x; ++u) {
      if (reach[u] == 0 || isDrawn(ids[u])) continue;
      index.at<int>(v, u) = static_cast<int>(rims_.size());
      rims_.push_back({u, v, {-1, -1}});
    }
  }
  rim_rows_.push_back(rims_.size());
  const auto look = [&](Rim& rim, int du, int dv) {
    const cv::Point q(rim.u + du, rim.v + dv);
    if (q.x < 0 || q.y < 0 || q.x >= region_.width || q.y >= region_.height) return;
    const int other = index.at<int>(q);
    const cv::Point drawn = other >= 0                             ? rims_[other].nearest
                            : isDrawnAtRest(centre_.ids(q.y)[q.x]) ? q
                                                                   : cv::Point(-1, -1);
    if (drawn.x < 0) return;
    const auto squared = [&](const cv::Point& p) {
      return (p.x - rim.u) * (p.x - rim.u) + (p.y - rim.v) * (p.y - rim.v);
    };
    if (rim.nearest.x < 0 || squared(drawn) < squared(rim.nearest)) rim.nearest = drawn;
  };
  for (int pass = 0; pass < 2; ++pass) {
    for (std::size_t i = 0; i < rims_.size(); ++i)
      look(rims_[i], -1, 0), look(rims_[i], -1, -1), look(rims_[i], 0, -1), look(rims_[i], 1, -1);
    for (std::size_t i = rims_.size(); i-- > 0;)
      look(rims_[i], 1, 0), look(rims_[i], 1, 1), look(rims_[i], 0, 1), look(rims_[i], -1, 1);
  }
}

// A pixel on the rims of two that have not moved is either's.
bool Residual::owns(int surface, const cv::Point& at) const {
  const int owner = rest_.owners.at<short>(at);
  return owner == surface || (owner >= 0 && !frame_.moved[owner] && !frame_.moved[surface]);
}

// The pixels around (u, v) that an owner has, with their bilinear weights.
template <class Act>
void Residual::forEachOwned(float u, float v, int owner, const Act& act) const {
  const float fu = std::floor(u), fv = std::floor(v), x = u - fu, y = v - fv;
  for (int k = 0; k < 4; ++k) {
    const float weight = ((k & 1) != 0 ? x : 1.0f - x) * ((k & 2) != 0 ? y : 1.0f - y);
    const cv::Point at(static_cast<int>(fu) + (k & 1), static_cast<int>(fv) + (k >> 1));
    if (weight > 0.0f && miss_box_.contains(at) && owns(owner, at)) act(at, weight);
  }
}

// What sways past its place in the key frame in another colour would flash there.
bool Residual::carries(const StagedObject& object) const {
  return !miss_.empty() && object.isAtRestInVideo() && !object.look.albedo &&
         !(object.look.tint && frame_.prepared.sways[object.surface]);
}

void Residual::addToStretch(int v, int first, int last, int slot, Row& row) const {
  if (!carries(frame_.objects[slot])) return;
  const int surface = frame_.objects[slot].surface, offset = (first + region_.x) % kLightStep;
  const cv::Point corner = frame_.prepared.appearances[surface].region.tl();
  for (int i = first; i < last; ++i) {
    const float u = static_cast<float>(i + region_.x),
                from_u = row.run.key_u[offset + i - first] + static_cast<float>(corner.x),
                from_v = row.run.key_v[offset + i - first] + static_cast<float>(corner.y);
    const Eigen::Vector2f moved(u - from_u, static_cast<float>(v) - from_v);
    if (!(moved.squaredNorm() < kNonePx * kNonePx)) continue;
    cv::Vec4f colour = row.at(i);
    cv::Vec3f tint = frame_.objects[slot].tint();
    if (mayBeDimmed(surface)) tint = tint.mul(dimmed(from_u, from_v, surface, tint, colour));
    addAt(from_u, from_v, moved, surface, tint, colour);
    row.set(i, colour);
  }
}

void Residual::addToPixel(std::uint32_t id, int u, int v, cv::Vec4f& colour) const {
  const StagedObject& object = frame_.objectOf(id);
  if (!carries(object)) return;
  const Eigen::Vector2f moved = frame_.movement(id, static_cast<float>(u), static_cast<float>(v));
  const cv::Point2f from(u - moved.x(), v - moved.y());
  cv::Vec3f tint = object.tint();
  if (mayBeDimmed(object.surface))
    tint = tint.mul(dimmed(from.x, from.y, object.surface, tint, colour));
  addAt(from.x, from.y, moved, object.surface, tint, colour);
}

void Residual::addRims(int v, const StillPixels& still, Row& row) const {
  if (rims_.empty()) return;
  for (std::size_t i = rim_rows_[v - region_.y]; i < rim_rows_[v - region_.y + 1]; ++i) {
    const Rim& rim = rims_[i];
    if (rim.nearest.x < 0 || row.source[rim.u] == kOriginal || still.isRelit(rim.u, v - region_.y))
      continue;
    const std::uint32_t id = centre_.ids(rim.nearest.y)[rim.nearest.x];
    const cv::Point from = rim.nearest + region_.tl();
    const Eigen::Vector2f moved =
        frame_.movement(id, static_cast<float>(from.x), static_cast<float>(from.y));
    // Where a surface that moves has turned away from, its rim has not come to.
    const cv::Point away = rim.nearest - cv::Point(rim.u, rim.v);
    const float reach = frame_.params.background.mask_margin_px + kNonePx;
    if (away.dot(away) > reach * reach && moved.norm() > kStillPx) continue;
    cv::Vec4f colour = row.at(rim.u);
    const cv::Vec3f plain(colour[0], colour[1], colour[2]);
    addAt(rim.u + region_.x - moved.x(), v - moved.y(), moved, frame_.objectOf(id).surface,
          cv::Vec3f::all(1), colour);
    // Beside a surface of a new look the video has the old one's hue.
    const bool repainted =
        away.dot(away) <= kRepaintReach * kRepaintReach && frame_.objectOf(id).look.changes();
    const float brighter =
        luminance({colour[0], colour[1], colour[2]}) / std::max(luminance(plain), kDark);
    for (int c = 0; repainted && c < 3; ++c) colour[c] = plain[c] * brighter;
    row.set(rim.u, colour);
  }
}

// Another sun, or another object that has come before it.
bool Residual::mayBeDimmed(int surface) const {
  const auto others =
      std::count(frame_.moved.begin(), frame_.moved.end(), true) - (frame_.moved[surface] ? 1 : 0);
  return frame_.input.sun.changes() || others > 0;
}

// Part of the video's light that is left on a pixel to which the surface at (u, v) has moved: of
// what drawing misses there is as much less.
cv::Vec3f Residual::dimmed(float u, float v, int owner, const cv::Vec3f& tint,
                           const cv::Vec4f& colour) const {
  cv::Vec3f drawn;
  float known = 0.0f;
  forEachOwned(u, v, owner, [&](const cv::Point& at, float weight) {
    const cv::Vec4f& miss = miss_.at<cv::Vec4f>(at - miss_box_.tl());
    const cv::Vec3f video = linearPixel(frame_.input.bgr, at.x, at.y);
    for (int c = 0; c < 3; ++c) drawn[c] += weight * std::max(0.0f, video[c] - miss[c]);
    known += weight;
  });
  if (known == 0.0f) return cv::Vec3f::all(1);
  cv::Vec3f left;
  for (int c = 0; c < 3; ++c)
    left[c] =
        std::min(1.0f, (std::max(0.0f, colour[c]) + kDark) / (tint[c] * drawn[c] / known + kDark));
  return left;
}

// What drawing misses of the video at (u, v), on a pixel to which the surface there has moved.
// @param tint of the surface's new look and light, which what was missed takes on
void Residual::addAt(float u, float v, const Eigen::Vector2f& moved, int owner,
                     const cv::Vec3f& tint, cv::Vec4f& colour) const {
  const float squared = moved.squaredNorm();
  const bool sways = frame_.prepared.sways[owner];
  const float none = sways ? kNoneSwaying : kNonePx;
  if (squared >= none * none) return;
  const float part = 1.0f - smoothStep(sways ? kWholeSwaying : kWholePx, none, std::sqrt(squared));
  const cv::Vec4f miss = missAt(u, v, owner);
  const float moves = std::min(
      1.0f, squared / (kWholePx * kWholePx));  // unmoved, the video comes back whatever was drawn
  for (int c = 0; c < 3; ++c) {
    const float whole = colour[c] + part * tint[c] * miss[c];
    colour[c] =
        whole +
        moves * (std::clamp(whole, colour[c] / kMostChange, colour[c] * kMostChange) - whole);
  }
  colour[3] *= 1.0f - part * miss[3];
}

// @return 0 where nothing is known of this owner
cv::Vec4f Residual::missAt(float u, float v, int owner) const {
  cv::Vec4f sum;
  forEachOwned(u, v, owner, [&](const cv::Point& at, float weight) {
    sum += weight * miss_.at<cv::Vec4f>(at - miss_box_.tl());
  });
  return sum;
}

}  // namespace calipso::render

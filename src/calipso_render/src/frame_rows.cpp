// The part of FrameCompositor that composes the picture row by row. Runs of pixels that see one triangle are shaded four
// values at a time; silhouettes and what else is special go through composedAt().

#include <cmath>
#include <opencv2/core/hal/intrin.hpp>

#include "bicubic.hpp"
#include "calipso_render/colour.hpp"
#include "frame_compositor.hpp"

namespace calipso::render {
namespace {

constexpr float kKept = 0.999f;  // of a pixel at rest: it keeps its bytes

cv::v_float32x4 wide(const cv::Vec3f& c, float fourth = 0.0f) { return {c[0], c[1], c[2], fourth}; }

cv::Vec4f linearOf(const cv::Vec3b& c) { return {linearFromCode(c[0]), linearFromCode(c[1]), linearFromCode(c[2]), 0.0f}; }

}  // namespace

// Light at the corners of row v's squares, interpolated between the corners above and below.
void FrameCompositor::lightRow(int v, Row& row) const {
  const int dv = v - region_.y;
  const Lit *above = &lit_[static_cast<std::size_t>(dv / kLightStep) * lit_columns_], *below = above + lit_columns_;
  const cv::v_float32x4 part = cv::v_setall_f32(static_cast<float>(dv % kLightStep) / kLightStep);
  row.light.resize(lit_columns_);
  for (int i = 0; i < lit_columns_; ++i) {
    const auto mix = [&](const cv::Vec4f& a, const cv::Vec4f& b, cv::Vec4f& out) {
      const cv::v_float32x4 x = cv::v_load(a.val);
      cv::v_store(out.val, x + part * (cv::v_load(b.val) - x));
    };
    mix(above[i].diffuse, below[i].diffuse, row.light[i].diffuse);
    mix(above[i].highlight, below[i].highlight, row.light[i].highlight);
  }
}

// Pixels [first, last) of row v, all of which see the triangle `id` and nothing of what lies behind.
void FrameCompositor::shadeRun(int v, int first, int last, std::uint32_t id, Row& row) const {
  const int slot = VisibilityBuffer::objectOf(id), triangle = VisibilityBuffer::triangleOf(id), surface = surface_of_slot_[slot];
  const TriangleMap& map = maps_[slot][triangle];
  const Appearance& appearance = prepared_.appearances[surface];
  const Look look = lookOf(slot);
  const Appearance::Source source = appearance.sources[triangle];
  const cv::v_float32x4 floor = wide(lightFloor(appearance.mean_light)), tint = wide(look.tint.value_or(cv::Vec3f(1, 1, 1)));
  const cv::v_float32x4 across = cv::v_load(map.key[1]), start = cv::v_load(map.key[0]) + cv::v_load(map.key[2]) * cv::v_setall_f32(v - map.v);
  const float* nearness = centre_->nearness(v - region_.y);
  const std::size_t squares = static_cast<std::size_t>((v - region_.y) / kLightStep) * lit_columns_;
  const bool carries = !miss_.empty() && !observed_[slot].points.empty();
  const float tolerance = kLightStep / static_cast<float>(frame_.camera.fx);
  for (int u = first; u < last; ++u) {
    const int i = u - region_.x, square = i / kLightStep;
    cv::Vec4f& out = row.colour[i];
    const cv::v_float32x4 part = cv::v_setall_f32(static_cast<float>(i % kLightStep) / kLightStep);
    const cv::v_float32x4 left = cv::v_load(row.light[square].diffuse.val), gloss = cv::v_load(row.light[square].highlight.val);
    const cv::v_float32x4 diffuse = left + part * (cv::v_load(row.light[square + 1].diffuse.val) - left);
    const float expected = cv::v_extract_n<3>(diffuse);
    const bool even = smooth_[squares + square] != 0 && lit_[squares + square].slot == slot && std::abs(nearness[i] - expected) <= tolerance * nearness[i];
    const cv::v_float32x4 key = start + across * cv::v_setall_f32(u - map.u), place = key / cv::v_broadcast_element<2>(key);
    const float x = cv::v_extract_n<0>(place), y = cv::v_extract_n<1>(place);
    if (map.thin || !even) {
      const cv::Vec3f colour = shadeSurface(id, static_cast<float>(u), static_cast<float>(v));
      out = {colour[0], colour[1], colour[2], 1.0f};
    } else {
      cv::v_float32x4 albedo;
      if (look.albedo) {
        albedo = wide(*look.albedo);
      } else if (source == Appearance::Source::kPicture) {
        albedo = bicubic(appearance.albedo, x - appearance.region.x, y - appearance.region.y);
      } else {
        const cv::Vec4f texel = appearance.texture.at(triangle, map.weightsAt(static_cast<float>(u), static_cast<float>(v)));
        albedo = cv::v_load(texel.val);
        if (source == Appearance::Source::kBoth && texel[3] > 0.001f) {
          albedo += cv::v_setall_f32(texel[3]) * (bicubic(appearance.albedo, x - appearance.region.x, y - appearance.region.y) - albedo);
        }
      }
      const cv::v_float32x4 highlight = gloss + part * (cv::v_load(row.light[square + 1].highlight.val) - gloss);
      cv::v_store(out.val, albedo * tint * (diffuse + floor) + highlight);
      out[3] = 1.0f;
    }
    row.source[i] = kRendered;
    if (carries && !map.thin) addResidual(x, y, {u - x, v - y}, surface, out);
  }
}

// A pixel that nothing is drawn in: behindAt(), four values at a time.
void FrameCompositor::composeBehind(int u, int v, Row& row) const {
  const int i = u - region_.x, j = v - region_.y;
  const bool removed = removed_.at<std::uint8_t>(j, i) != 0;
  const float sun = sun_now_.at<float>(j, i), from_plate = removed ? 1.0f : relit_.at<float>(j, i);
  const cv::v_float32x4 umbra = wide(prepared_.umbra), lit = cv::v_setall_f32(1.0f) - umbra;
  const cv::v_float32x4 now = sun < 0.0f ? cv::v_setall_f32(1.0f) : umbra * cv::v_setall_f32(sky_now_.at<float>(j, i)) + lit * cv::v_setall_f32(sun);
  cv::v_float32x4 colour = cv::v_setzero_f32();
  float fresh = 0.0f;
  row.source[i] = kRendered;
  if (from_plate > 0.0f) {
    const Behind revealed = revealedAt(u, v);
    colour = cv::v_setall_f32(from_plate) * wide(revealed.colour) * now;
    fresh = from_plate * revealed.fresh;
    if (from_plate > 0.5f) row.source[i] = revealed.source;
  }
  if (from_plate < 1.0f) {
    // Darkened further, a pixel keeps its own grain; what the original shaded must come from the plate.
    const cv::v_float32x4 before = umbra * cv::v_setall_f32(sky_before_.at<float>(j, i)) + lit * cv::v_setall_f32(sun_before_.at<float>(j, i));
    const cv::v_float32x4 ratio = cv::v_min(cv::v_setall_f32(1.0f), now / cv::v_max(before, cv::v_setall_f32(kDarkest)));
    colour += cv::v_setall_f32(1.0f - from_plate) * cv::v_load(linearOf(frame_.bgr.at<cv::Vec3b>(v, u)).val) * ratio;
  }
  cv::v_store(row.colour[i].val, colour);
  row.colour[i][3] = fresh;
}

// A pixel that needs more than one surface.
void FrameCompositor::composeSpecial(int u, int v, Row& row) const {
  const Composed pixel = composedAt(u, v);
  const int i = u - region_.x;
  cv::Vec4f& out = row.colour[i];
  out = {pixel.colour[0], pixel.colour[1], pixel.colour[2], pixel.fresh};
  row.source[i] = pixel.source;
  const std::uint32_t id = centre_->idAt(u, v);
  if (miss_.empty() || pixel.source == kOriginal || id == VisibilityBuffer::kNothing) return;
  const int slot = VisibilityBuffer::objectOf(id);
  if (observed_[slot].points.empty() || screenAt(u, v) > 0.0f) return;
  const Eigen::Vector2f moved = movement(id, static_cast<float>(u), static_cast<float>(v));
  addResidual(u - moved.x(), v - moved.y(), moved, surface_of_slot_[slot], out);
}

void FrameCompositor::drawRow(int v, Row& row) const {
  const int j = v - region_.y;
  const std::uint32_t* ids = centre_->ids(j);
  const int* edges = edges_->slots(j);
  const std::uint8_t *removed = removed_.ptr<std::uint8_t>(j), *relit = changed_.ptr<std::uint8_t>(j);
  const float* still = still_.ptr<float>(j);
  std::fill(row.source.begin(), row.source.end(), static_cast<std::uint8_t>(kOriginal));
  lightRow(v, row);
  const auto isPlain = [&](int i) { return edges[i] < 0 && still[i] < kKept && isDrawn(ids[i], region_.x + i, v) && screenAt(region_.x + i, v) == 0.0f; };
  for (int i = 0; i < region_.width;) {
    const bool seen = ids[i] != VisibilityBuffer::kNothing;
    if (!seen && edges[i] < 0 && (removed[i] | relit[i]) == 0) {
      ++i;
    } else if (isPlain(i)) {
      int end = i + 1;
      while (end < region_.width && ids[end] == ids[i] && isPlain(end)) ++end;
      shadeRun(v, region_.x + i, region_.x + end, ids[i], row);
      i = end;
    } else if (!seen && edges[i] < 0) {
      if (still[i] < kKept || removed[i] == 0) composeBehind(region_.x + i, v, row);
      ++i;
    } else {
      if (still[i] < kKept || removed[i] == 0) composeSpecial(region_.x + i, v, row);
      ++i;
    }
  }
}

// Where the surface rests, the frame's own pixel is the best picture of it.
void FrameCompositor::keepStill(int v, Row& row) const {
  const int j = v - region_.y;
  const std::uint8_t* removed = removed_.ptr<std::uint8_t>(j);
  const float* still = still_.ptr<float>(j);
  const cv::Vec3b* frame = frame_.bgr.ptr<cv::Vec3b>(v) + region_.x;
  for (int i = 0; i < region_.width; ++i) {
    if (still[i] == 0.0f || row.source[i] == kOriginal || (removed[i] == 0 && row.source[i] != kRendered)) continue;
    if (still[i] >= kKept) row.source[i] = kOriginal;
    else row.colour[i] = still[i] * linearOf(frame[i]) + (1.0f - still[i]) * row.colour[i];
  }
}

void FrameCompositor::composeRow(int v, Row& row, FrameOutput& out) const {
  row.colour.resize(region_.width);
  row.source.resize(region_.width);
  drawRow(v, row);
  addRimResidual(v, row);
  keepStill(v, row);
  cv::Vec3b* codes = out.bgr.ptr<cv::Vec3b>(v) + region_.x;
  std::uint8_t* provenance = out.provenance.ptr<std::uint8_t>(v) + region_.x;
  for (int i = 0; i < region_.width;) {
    int end = i;
    while (end < region_.width && row.source[end] != kOriginal) ++end;
    if (end > i) codec_.encode(&row.colour[i], region_.x + i, v, end - i, codes + i);
    i = end + 1;
  }
  std::copy(row.source.begin(), row.source.end(), provenance);
}

}  // namespace calipso::render

// The part of FrameCompositor that composes the picture row by row. Stretches of pixels that see
// one object are shaded together; silhouettes and what else is special go through composedAt().

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core/hal/intrin.hpp>

#include "calipso_render/colour.hpp"
#include "frame_compositor.hpp"
#include "kernels.hpp"
#include "marked.hpp"

namespace calipso::render {
namespace {

constexpr float kKept = 0.999f;  // of a pixel at rest: it keeps its bytes

cv::v_float32x4 wide(const cv::Vec3f& c, float fourth = 0.0f) { return {c[0], c[1], c[2], fourth}; }

cv::v_float32x4 linearOf(const float* decoded, const cv::Vec3b& c) {
  return {decoded[c[0]], decoded[c[1]], decoded[c[2]], 0.0f};
}

}  // namespace

// What has to be done for every pixel of row v.
void FrameCompositor::findKinds(int v, Row& row) const {
  const int j = v - region_.y, width = region_.width;
  const auto rowOf = [j](const cv::Mat& picture) { return picture.ptr<std::uint8_t>(j); };
  const std::uint8_t *sun = rowOf(sun_now_), *sun_before = rowOf(sun_before_),
                     *sky = rowOf(sky_now_), *sky_before = rowOf(sky_before_);
  const std::uint8_t *labels = labels_.ptr<std::uint8_t>(v) + region_.x, *drawn = rowOf(drawn_),
                     *takes = rowOf(takes_light_);
  const std::uint8_t *removed = rowOf(removed_), *relit = rowOf(relit_);
  const std::uint32_t* ids = centre_->ids(j);
  Kind* kinds = row.kinds.data();
  std::uint8_t* out = reinterpret_cast<std::uint8_t*>(kinds);
  for (int i = 0; i < width; ++i) {
    const std::uint8_t sun_change =
        std::max(sun[i], sun_before[i]) - std::min(sun[i], sun_before[i]);
    const std::uint8_t sky_change =
        std::max(sky[i], sky_before[i]) - std::min(sky[i], sky_before[i]);
    const std::uint8_t change =
        std::min<std::uint8_t>(sun_change, 100) + std::min<std::uint8_t>(sky_change, 100);
    const std::uint8_t differs =
        ((relit[i] != 0) | (change >= kSameLevels)) & (takes[i] != 0) & (labels[i] == 0);
    const std::uint8_t behind = (differs | (removed[i] != 0)) != 0 ? kBehind : kNone;
    out[i] = drawn[i] != 0 ? static_cast<std::uint8_t>(kPlain) : behind;
  }
  // What hides a surface at rest takes its residual.
  for (int i = 0; !all_drawn_ && i < width; ++i)
    kinds[i] = kinds[i] == kBehind && ids[i] != VisibilityBuffer::kNothing ? kSpecial : kinds[i];
  edges_->visitRow(j, [kinds](int i, bool settled) {
    if (!settled)
      kinds[i] = kSpecial;
    else if (kinds[i] == kPlain)
      kinds[i] = kPlainEdge;
  });
  if (!still_.empty()) {
    const float* still = still_.ptr<float>(j);
    for (int i = 0; i < width; ++i) {
      if (still[i] >= kKept && kinds[i] != kNone)
        kinds[i] = removed[i] != 0 ? kNone : isPlain(kinds[i]) ? kSpecial : kinds[i];
    }
  }
  if (!screened_.empty()) {
    const std::uint8_t* screened = screened_.ptr<std::uint8_t>(j);
    for (int i = 0; i < width; ++i)
      kinds[i] = screened[i] != 0 && isPlain(kinds[i]) ? kSpecial : kinds[i];
  }
  if (!remirrored_.empty()) {
    const std::uint8_t* remirrored = remirrored_.ptr<std::uint8_t>(v) + region_.x;
    for (int i = 0; i < width; ++i)
      kinds[i] =
          remirrored[i] == kChanged && kinds[i] == kNone && labels[i] == 0 ? kBehind : kinds[i];
  }
  if (!any_shaded_) return;
  for (int i = 0; i < width; ++i) {
    const bool other = ids[i] != VisibilityBuffer::kNothing && drawn[i] == 0;
    if (other && labels[i] != 0 && removed[i] == 0 && kinds[i] != kSpecial) kinds[i] = kSpecial;
  }
}

// Light at the corners of row v's squares, interpolated between the corners above and below.
void FrameCompositor::lightRow(int v, Row& row) const {
  const int dv = v - region_.y;
  const Lit *above = &lit_[static_cast<std::size_t>(dv / kLightStep) * lit_columns_],
            *below = above + lit_columns_;
  const cv::v_float32x4 part = cv::v_setall_f32(static_cast<float>(dv % kLightStep) / kLightStep);
  row.light.resize(lit_columns_);
  for (int i = 0; i < lit_columns_; ++i) {
    if (above[i].slot < 0 && below[i].slot < 0) continue;
    const auto mix = [&](const cv::Vec4f& a, const cv::Vec4f& b, cv::Vec4f& out) {
      const cv::v_float32x4 x = cv::v_load(a.val);
      cv::v_store(out.val, x + part * (cv::v_load(b.val) - x));
    };
    mix(above[i].diffuse, below[i].diffuse, row.light[i].diffuse);
    mix(above[i].highlight, below[i].highlight, row.light[i].highlight);
  }
}

// Reflectance of the pixels [first, last) of row v, all of which see the object in `slot`, into
// row.colour; where they lie in the key frame's picture into row.key_u, row.key_v.
void FrameCompositor::reflectStretch(int v, int first, int last, int slot, Row& row) const {
  const Appearance& appearance = prepared_.appearances[surface_of_slot_[slot]];
  const std::uint32_t* ids = centre_->ids(v - region_.y);
  bool any_picture = false, any_texture = false;
  for (int i = first; i < last;) {
    const std::uint32_t id = ids[i];
    const Appearance::Source source = appearance.sources[VisibilityBuffer::triangleOf(id)];
    any_picture |= source != Appearance::Source::kTexture,
        any_texture |= source != Appearance::Source::kPicture;
    while (i < last && ids[i] == id) ++i;
  }
  kernels().locate(maps_[slot].data(), &ids[first], first + region_.x, v, last - first,
                   appearance.region.tl(), &row.key_u[first], &row.key_v[first]);
  const std::optional<cv::Vec3f>& albedo = lookOf(slot).albedo;
  if (albedo) {
    std::fill(&row.colour[first], &row.colour[last - 1] + 1,
              cv::Vec4f((*albedo)[0], (*albedo)[1], (*albedo)[2], 0.0f));
    return;
  }
  if (any_picture)
    kernels().sample(appearance.albedo, &row.key_u[first], &row.key_v[first], last - first,
                     &row.colour[first]);
  for (int i = first; any_texture && i < last; ++i) {
    const int triangle = VisibilityBuffer::triangleOf(ids[i]);
    const Appearance::Source source = appearance.sources[triangle];
    if (source == Appearance::Source::kPicture || maps_[slot][triangle].thin) continue;
    const cv::Vec4f texel = appearance.texture.at(
        triangle,
        maps_[slot][triangle].weightsAt(static_cast<float>(i + region_.x), static_cast<float>(v)));
    row.colour[i] =
        source == Appearance::Source::kTexture ? texel : texel + texel[3] * (row.colour[i] - texel);
  }
}

// Light from the corners on the pixels [first, last), whose reflectance row.colour has; row.uneven
// names those on which light has to be computed.
void FrameCompositor::shadeStretch(int v, int first, int last, int slot, Row& row) const {
  const Appearance& appearance = prepared_.appearances[surface_of_slot_[slot]];
  const cv::v_float32x4 floor = wide(lightFloor(appearance.mean_light)), tint = wide(tintOf(slot));
  const float* nearness = centre_->nearness(v - region_.y);
  const std::size_t squares = static_cast<std::size_t>((v - region_.y) / kLightStep) * lit_columns_;
  const float tolerance = kLightStep / static_cast<float>(frame_.camera.fx);
  row.uneven.clear();
  for (int i = first; i < last;) {
    const int square = i / kLightStep, end = std::min(last, (square + 1) * kLightStep);
    const bool smooth = smooth_[squares + square] != 0 && lit_[squares + square].slot == slot;
    if (!smooth) {
      for (; i < end; ++i) row.uneven.push_back(i);
      continue;
    }
    const Lit &a = row.light[square], &b = row.light[square + 1];
    const cv::v_float32x4 left = cv::v_load(a.diffuse.val), rise = cv::v_load(b.diffuse.val) - left;
    const cv::v_float32x4 gloss = cv::v_load(a.highlight.val),
                          gloss_rise = cv::v_load(b.highlight.val) - gloss;
    for (; i < end; ++i) {
      if (row.kinds[i] == kPlainEdge) {
        row.uneven.push_back(i);
        continue;
      }
      const cv::v_float32x4 part =
          cv::v_setall_f32(static_cast<float>(i % kLightStep) / kLightStep);
      const cv::v_float32x4 diffuse = left + part * rise;
      // Another piece of the surface can look out between the corners.
      if (std::abs(nearness[i] - cv::v_extract_n<3>(diffuse)) > tolerance * nearness[i]) {
        row.uneven.push_back(i);
        continue;
      }
      cv::Vec4f& out = row.colour[i];
      cv::v_store(out.val,
                  cv::v_load(out.val) * tint * (diffuse + floor) + (gloss + part * gloss_rise));
      out[3] = 1.0f;
    }
  }
}

// Pixels [first, last) of row v, all of which see the object in `slot` and nothing of what lies
// behind.
void FrameCompositor::drawStretch(int v, int first, int last, int slot, Row& row) const {
  const int surface = surface_of_slot_[slot];
  const Appearance& appearance = prepared_.appearances[surface];
  reflectStretch(v, first, last, slot, row);
  shadeStretch(v, first, last, slot, row);
  const cv::v_float32x4 floor = wide(lightFloor(appearance.mean_light)), tint = wide(tintOf(slot));
  const std::uint32_t* ids = centre_->ids(v - region_.y);
  for (const int i : row.uneven) {
    const int triangle = VisibilityBuffer::triangleOf(ids[i]);
    cv::Vec4f& out = row.colour[i];
    if (maps_[slot][triangle].thin || row.kinds[i] == kPlainEdge) {
      const cv::Vec3f colour =
          shadeSurface(ids[i], static_cast<float>(i + region_.x), static_cast<float>(v));
      out = {colour[0], colour[1], colour[2], 1.0f};
      continue;
    }
    const Lit lit = exactLight(litPoint(actors_[slot], triangle, static_cast<float>(i + region_.x),
                                        static_cast<float>(v), eye_),
                               slot);
    cv::v_store(out.val, cv::v_load(out.val) * tint * (cv::v_load(lit.diffuse.val) + floor) +
                             cv::v_load(lit.highlight.val));
    out[3] = 1.0f;
  }
  std::memset(&row.source[first], kRendered, last - first);
  if (miss_.empty() || observed_[slot].points.empty() || lookOf(slot).albedo) return;
  const cv::Point corner = appearance.region.tl();
  for (int i = first; i < last; ++i) {
    if (maps_[slot][VisibilityBuffer::triangleOf(ids[i])].thin) continue;
    const float x = row.key_u[i] + corner.x, y = row.key_v[i] + corner.y;
    addResidual(x, y, {i + region_.x - x, v - y}, surface, tintOf(slot), row.colour[i]);
  }
}

// Pixels [first, last) of row v that nothing is drawn in: behindAt(), four values at a time.
void FrameCompositor::composeBehind(int v, int first, int last, Row& row) const {
  const int j = v - region_.y;
  const auto rowOf = [j](const cv::Mat& picture) { return picture.ptr<std::uint8_t>(j); };
  const std::uint8_t *sun = rowOf(sun_now_), *sun_before = rowOf(sun_before_),
                     *sky = rowOf(sky_now_), *sky_before = rowOf(sky_before_);
  const std::uint8_t *removed = rowOf(removed_), *relit = rowOf(relit_),
                     *takes = rowOf(takes_light_),
                     *invented = invented_.ptr<std::uint8_t>(v) + region_.x;
  const cv::Vec3f* plate = plate_.ptr<cv::Vec3f>(v) + region_.x;
  const cv::Vec3b* frame = frame_.bgr.ptr<cv::Vec3b>(v) + region_.x;
  const float* decoded = decodeTable();
  const cv::v_float32x4 one = cv::v_setall_f32(1.0f), brightest = cv::v_setall_f32(kBrightest),
                        umbra = wide(prepared_.umbra) * cv::v_setall_f32(kPerLevel),
                        lit = cv::v_setall_f32(kPerLevel) - umbra;
  const auto ratioOf = [&](std::uint8_t sun_level, std::uint8_t sky_level) {
    return umbra * cv::v_setall_f32(sky_level) + lit * cv::v_setall_f32(sun_level);
  };
  const std::uint8_t* mirrored =
      remirrored_.empty() ? nullptr : remirrored_.ptr<std::uint8_t>(v) + region_.x;
  for (int i = first; i < last; ++i) {
    if (mirrored != nullptr && mirrored[i] != 0) {
      const Behind behind = groundAt(i + region_.x, v, removed[i] != 0);
      row.colour[i] = {behind.colour[0], behind.colour[1], behind.colour[2], behind.fresh},
      row.source[i] = behind.source;
      continue;
    }
    const float from_plate = removed[i] != 0 ? 1.0f : relit[i] * kPerLevel;
    const cv::v_float32x4 now = takes[i] == 0 ? one : ratioOf(sun[i], sky[i]);
    cv::v_float32x4 colour = cv::v_setzero_f32();
    float fresh = 0.0f;
    row.source[i] = kRendered;
    if (from_plate > 0.0f) {
      Behind revealed{plate[i], 1.0f, invented[i] != 0 ? kInvented : kSeenElsewhere};
      if (invented[i] != 0 && live_ != nullptr) revealed = revealedAt(i + region_.x, v);
      colour = cv::v_setall_f32(from_plate) * wide(revealed.colour) * now;
      fresh = from_plate * revealed.fresh;
      if (from_plate > 0.5f) row.source[i] = revealed.source;
    }
    if (from_plate < 1.0f) {
      // Darkened further or seeing a little more sky, a pixel keeps its own grain; what the sun
      // newly reaches must come from the plate.
      const cv::v_float32x4 before = ratioOf(sun_before[i], sky_before[i]);
      const cv::v_float32x4 ratio =
          cv::v_min(brightest, now / cv::v_max(before, cv::v_setall_f32(kDarkest)));
      colour += cv::v_setall_f32(1.0f - from_plate) * linearOf(decoded, frame[i]) * ratio;
    }
    cv::v_store(row.colour[i].val, colour);
    row.colour[i][3] = fresh;
  }
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
  if (observed_[slot].points.empty() || lookOf(slot).albedo || screenAt(u, v) > 0.0f) return;
  const Eigen::Vector2f moved = movement(id, static_cast<float>(u), static_cast<float>(v));
  addResidual(u - moved.x(), v - moved.y(), moved, surface_of_slot_[slot], tintOf(slot), out);
}

void FrameCompositor::drawRow(int v, Row& row) const {
  const std::uint32_t* ids = centre_->ids(v - region_.y);
  findKinds(v, row);
  lightRow(v, row);
  std::memset(row.source.data(), kOriginal, row.source.size());
  for (int i = nextMarked(row.kinds.data(), 0, region_.width); i < region_.width;
       i = nextMarked(row.kinds.data(), i, region_.width)) {
    const int u = i + region_.x;
    if (isPlain(row.kinds[i])) {
      const int first = i, slot = VisibilityBuffer::objectOf(ids[i]);
      while (i < region_.width && isPlain(row.kinds[i]) &&
             VisibilityBuffer::objectOf(ids[i]) == slot)
        ++i;
      drawStretch(v, first, i, slot, row);
    } else if (row.kinds[i] == kBehind) {
      const int first = i;
      while (i < region_.width && row.kinds[i] == kBehind) ++i;
      composeBehind(v, first, i, row);
    } else {
      composeSpecial(u, v, row);
      ++i;
    }
  }
}

// Where the surface rests, the frame's own pixel is the best picture of it.
void FrameCompositor::keepStill(int v, Row& row) const {
  if (still_.empty()) return;
  const int j = v - region_.y;
  const std::uint8_t* removed = removed_.ptr<std::uint8_t>(j);
  const float* still = still_.ptr<float>(j);
  const cv::Vec3b* frame = frame_.bgr.ptr<cv::Vec3b>(v) + region_.x;
  for (int i = 0; i < region_.width; ++i) {
    if (still[i] == 0.0f || row.source[i] == kOriginal ||
        (removed[i] == 0 && row.source[i] != kRendered))
      continue;
    if (still[i] >= kKept)
      row.source[i] = kOriginal;
    else
      cv::v_store(row.colour[i].val,
                  cv::v_setall_f32(still[i]) * linearOf(decodeTable(), frame[i]) +
                      cv::v_setall_f32(1.0f - still[i]) * cv::v_load(row.colour[i].val));
  }
}

void FrameCompositor::composeRow(int v, Row& row, FrameOutput& out) const {
  row.resize(region_.width);
  drawRow(v, row);
  addRimResidual(v, row);
  keepStill(v, row);
  cv::Vec3b* codes = out.bgr.ptr<cv::Vec3b>(v) + region_.x;
  const std::uint8_t* source = row.source.data();
  for (int i = nextMarked(source, 0, region_.width); i < region_.width;
       i = nextMarked(source, i, region_.width)) {
    const int first = i;
    while (i < region_.width && source[i] != kOriginal) ++i;
    codec_.encode(&row.colour[first], region_.x + first, v, i - first, codes + first);
  }
  std::memcpy(out.provenance.ptr<std::uint8_t>(v) + region_.x, source, row.source.size());
}

}  // namespace calipso::render

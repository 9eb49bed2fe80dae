// The part of FrameCompositor that composes the picture row by row. Stretches of pixels that see
// one object are shaded together; silhouettes and what else is special go through composedOf().

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core/hal/intrin.hpp>

#include "calipso_render/colour.hpp"
#include "frame_compositor.hpp"
#include "kernels.hpp"
#include "marked.hpp"
#include "wide_loops.hpp"

namespace calipso::render {
namespace {

constexpr float kKept = 0.999f;  // of a pixel at rest: it keeps its bytes

cv::v_float32x4 wide(const cv::Vec3f& c, float fourth = 0.0f) { return {c[0], c[1], c[2], fourth}; }

cv::v_float32x4 linearOf(const float* decoded, const cv::Vec3b& c) {
  return {decoded[c[0]], decoded[c[1]], decoded[c[2]], 0.0f};
}

}  // namespace

// Of columns [begin, end) of region_'s row j: what lies behind, where its light changes or where
// it comes to light.
CALIPSO_WIDE_LOOPS void FrameCompositor::findBehind(int j, int begin, int end, Kind* kinds) const {
  const auto rowOf = [j](const cv::Mat& picture) { return picture.ptr<std::uint8_t>(j); };
  const std::uint8_t *sun = rowOf(sun_now_), *sun_before = rowOf(sun_before_),
                     *sky = rowOf(sky_now_), *sky_before = rowOf(sky_before_);
  const std::uint8_t *labels = labels_.ptr<std::uint8_t>(j + region_.y) + region_.x,
                     *takes = rowOf(takes_light_), *removed = rowOf(removed_),
                     *relit = rowOf(relit_);
  std::uint8_t* out = reinterpret_cast<std::uint8_t*>(kinds);
  for (int i = begin; i < end; ++i) {
    const std::uint8_t sun_change =
        std::max(sun[i], sun_before[i]) - std::min(sun[i], sun_before[i]);
    const std::uint8_t sky_change =
        std::max(sky[i], sky_before[i]) - std::min(sky[i], sky_before[i]);
    const std::uint8_t change =
        std::min<std::uint8_t>(sun_change, 100) + std::min<std::uint8_t>(sky_change, 100);
    const std::uint8_t differs =
        ((relit[i] != 0) | (change >= kSameLevels)) & (takes[i] != 0) & (labels[i] == 0);
    const std::uint8_t behind = (differs | (removed[i] != 0)) != 0 ? kBehind : kNone;
    out[i] = out[i] == kNone ? behind : out[i];
  }
}

// What has to be done for every pixel of row v.
CALIPSO_WIDE_LOOPS void FrameCompositor::findKinds(int v, Row& row) const {
  const int j = v - region_.y, width = region_.width;
  const std::uint8_t *labels = labels_.ptr<std::uint8_t>(v) + region_.x,
                     *drawn = drawn_.ptr<std::uint8_t>(j), *removed = removed_.ptr<std::uint8_t>(j);
  const std::uint32_t* ids = centre_->ids(j);
  Kind* kinds = row.kinds.data();
  for (int i = 0; i < width; ++i)
    reinterpret_cast<std::uint8_t*>(kinds)[i] = drawn[i] & static_cast<std::uint8_t>(kPlain);
  relightable_.visitRow(v, region_.x, region_.br().x, [&](int begin, int end) {
    findBehind(j, begin - region_.x, end - region_.x, kinds);
  });
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
      row.set(i, {behind.colour[0], behind.colour[1], behind.colour[2], behind.fresh});
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
    cv::Vec4f out;
    cv::v_store(out.val, colour);
    out[3] = fresh;
    row.set(i, out);
  }
}

// A pixel that needs more than one surface.
void FrameCompositor::composeSpecial(int u, int v, Row& row) const {
  const int i = u - region_.x;
  const Composed pixel = composedOf(row.drawn[i], u, v);
  cv::Vec4f out(pixel.colour[0], pixel.colour[1], pixel.colour[2], pixel.fresh);
  row.set(i, out);
  row.source[i] = pixel.source;
  const std::uint32_t id = centre_->idAt(u, v);
  if (miss_.empty() || pixel.source == kOriginal || id == VisibilityBuffer::kNothing) return;
  const int slot = VisibilityBuffer::objectOf(id);
  if (observed_[slot].points.empty() || lookOf(slot).albedo || screenAt(u, v) > 0.0f) return;
  const Eigen::Vector2f moved = movement(id, static_cast<float>(u), static_cast<float>(v));
  addResidual(u - moved.x(), v - moved.y(), moved, surface_of_slot_[slot], tintOf(slot), out);
  row.set(i, out);
}

void FrameCompositor::drawRow(int v, Row& row) const {
  const std::uint32_t* ids = centre_->ids(v - region_.y);
  findKinds(v, row);
  findSheets(v, row);
  shadeSheets(v, row);
  std::memset(row.source.data(), kOriginal, row.source.size());
  for (int i = nextMarked(row.kinds.data(), 0, region_.width); i < region_.width;
       i = nextMarked(row.kinds.data(), i, region_.width)) {
    const int u = i + region_.x;
    if (isPlain(row.kinds[i])) {
      const int first = i, slot = VisibilityBuffer::objectOf(ids[i]),
                end = std::min(region_.width,
                               (u / SurfaceRun::kMost + 1) * SurfaceRun::kMost - region_.x);
      while (i < end && isPlain(row.kinds[i]) && VisibilityBuffer::objectOf(ids[i]) == slot) ++i;
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
    if (still[i] >= kKept) {
      row.source[i] = kOriginal;
      continue;
    }
    cv::Vec4f mixed;
    cv::v_store(mixed.val, cv::v_setall_f32(still[i]) * linearOf(decodeTable(), frame[i]) +
                               cv::v_setall_f32(1.0f - still[i]) * cv::v_load(row.at(i).val));
    row.set(i, mixed);
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
    codec_.encode({&row.colour[0][first], &row.colour[1][first], &row.colour[2][first],
                   &row.colour[3][first]},
                  region_.x + first, v, i - first, codes + first);
  }
  std::memcpy(out.provenance.ptr<std::uint8_t>(v) + region_.x, source, row.source.size());
}

}  // namespace calipso::render

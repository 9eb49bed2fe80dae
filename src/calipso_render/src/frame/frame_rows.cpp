// The part of FrameCompositor that composes the picture row by row. Stretches of pixels that see
// one object are shaded together; silhouettes and what else is special go through composedOf().

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core/hal/intrin.hpp>

#include "calipso_render/colour.hpp"
#include "draw/kernels.hpp"
#include "draw/wide_loops.hpp"
#include "frame/frame_compositor.hpp"
#include "frame/marked.hpp"

namespace calipso::render {
namespace {

constexpr float kKept = 0.999f;  // of a pixel at rest: it keeps its bytes

cv::v_float32x4 linearOf(const float* decoded, const cv::Vec3b& c) {
  return {decoded[c[0]], decoded[c[1]], decoded[c[2]], 0.0f};
}

// The light on pixels of a row: levels now and before, 255 where a change is taken at all, where
// the place comes to light, and how far the original's shadow is to be taken from the plate.
struct LightLevels {
  const std::uint8_t *sun, *sun_before, *sky, *sky_before, *takes, *removed, *relit;
};

// What it makes of them.
struct LightFactors {
  static constexpr int kMost = 64;
  float from_plate[kMost];  // part that is taken from the plate
  // times the plate; times the frame's own pixel, which keeps its grain where it is darkened
  // further or sees a little more sky: what the sun newly reaches must come from the plate
  float now[3][kMost], change[3][kMost];
};

CALIPSO_WIDE_LOOPS void findLightFactors(const LightLevels& at, const cv::Vec3f& full_umbra,
                                         int count, LightFactors& out) {
  for (int i = 0; i < count; ++i)
    out.from_plate[i] = at.removed[i] != 0 ? 1.0f : static_cast<float>(at.relit[i]) * kPerLevel;
  for (int c = 0; c < 3; ++c) {
    const float umbra = full_umbra[c] * kPerLevel, lit = kPerLevel - umbra;
    for (int i = 0; i < count; ++i) {
      const float all = umbra * static_cast<float>(at.sky[i]) + lit * static_cast<float>(at.sun[i]),
                  now = at.takes[i] == 0 ? 1.0f : all,
                  before = umbra * static_cast<float>(at.sky_before[i]) +
                           lit * static_cast<float>(at.sun_before[i]),
                  ratio = now / (before > kDarkest ? before : kDarkest);
      out.now[c][i] = now;
      out.change[c][i] = ratio < kBrightest ? ratio : kBrightest;
    }
  }
}

// Linear colours of `count` pixels, by channels, from the plate and from the frame's codes.
CALIPSO_WIDE_LOOPS void relight(const LightFactors& factors, const cv::Vec3f* plate,
                                const cv::Vec3b* frame, int count, float* const (&out)[3]) {
  const float* decoded = decodeTable();
  float own[LightFactors::kMost], place[LightFactors::kMost];
  for (int c = 0; c < 3; ++c) {
    for (int k = 0; k < count; ++k) own[k] = decoded[frame[k][c]], place[k] = plate[k][c];
    for (int k = 0; k < count; ++k) {
      const float from_plate = factors.from_plate[k];
      out[c][k] = from_plate * place[k] * factors.now[c][k] +
                  (1.0f - from_plate) * own[k] * factors.change[c][k];
    }
  }
}

// Asks for what the next row will read: its stretches lie below this one's.
void prefetchRow(const cv::Mat& picture, int v, int u, int count) {
  if (v >= picture.rows) return;
  const std::uint8_t* from = picture.ptr(v, u);
  for (std::size_t k = 0; k < count * picture.elemSize(); k += 64) __builtin_prefetch(from + k);
}

// How many of the pixels see the object that the first sees, from that on.
CALIPSO_WIDE_LOOPS int countOfFirst(const std::uint32_t* ids, int count) {
  std::uint32_t differ = 0;
  for (int k = 0; k < count; ++k) differ |= ids[k] ^ ids[0];
  if ((differ >> 24) == 0) return count;
  int same = 1;
  while (((ids[same] ^ ids[0]) >> 24) == 0) ++same;
  return same;
}

}  // namespace

// Of columns [begin, end) of region_'s row j: what lies behind, where its light changes or where
// it comes to light.
CALIPSO_WIDE_LOOPS void FrameCompositor::findBehind(int j, int begin, int end, Kind* kinds) const {
  const auto rowOf = [j](const cv::Mat& picture) { return picture.ptr<std::uint8_t>(j); };
  const std::uint8_t *sun = rowOf(sun_now_), *sun_before = rowOf(sun_before_),
                     *sky = rowOf(sky_now_), *sky_before = rowOf(sky_before_);
  const std::uint8_t *labels = frame_.labels.ptr<std::uint8_t>(j + region_.y) + region_.x,
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
  const std::uint8_t *labels = frame_.labels.ptr<std::uint8_t>(v) + region_.x,
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

// Pixels [first, last) of row v that nothing is drawn in: behindAt().
void FrameCompositor::composeBehind(int v, int first, int last, Row& row) const {
  const int j = v - region_.y;
  for (int i = first; i < last; i += LightFactors::kMost)
    composeRelit(v, i, std::min(last, i + LightFactors::kMost), row);
  if (remirrored_.empty() && place_.live == nullptr) return;
  const std::uint8_t *mirrored = remirrored_.empty() ? nullptr
                                                     : remirrored_.ptr<std::uint8_t>(v) + region_.x,
                     *invented = place_.invented.ptr<std::uint8_t>(v) + region_.x,
                     *removed = removed_.ptr<std::uint8_t>(j), *relit = relit_.ptr<std::uint8_t>(j);
  for (int i = first; i < last; ++i) {
    const bool filled_live =
        place_.live != nullptr && invented[i] != 0 && (removed[i] | relit[i]) != 0;
    if (!filled_live && (mirrored == nullptr || mirrored[i] == 0)) continue;
    const Behind behind = groundAt(i + region_.x, v, removed[i] != 0);
    row.set(i, {behind.colour[0], behind.colour[1], behind.colour[2], behind.fresh});
    row.source[i] = behind.source;
  }
}

// The same of at most LightFactors::kMost pixels, from the plate as it was prepared and without
// what planes mirror.
void FrameCompositor::composeRelit(int v, int first, int last, Row& row) const {
  const int j = v - region_.y, count = last - first;
  const auto rowOf = [&](const cv::Mat& picture) { return picture.ptr<std::uint8_t>(j) + first; };
  LightFactors factors;
  findLightFactors({rowOf(sun_now_), rowOf(sun_before_), rowOf(sky_now_), rowOf(sky_before_),
                    rowOf(takes_light_), rowOf(removed_), rowOf(relit_)},
                   frame_.prepared.umbra, count, factors);
  const int u = first + region_.x;
  const std::uint8_t* invented = place_.invented.ptr<std::uint8_t>(v) + u;
  const cv::Vec3f* plate = place_.plate.ptr<cv::Vec3f>(v) + u;
  const cv::Vec3b* frame = frame_.input.bgr.ptr<cv::Vec3b>(v) + u;
  prefetchRow(place_.plate, v + 1, u, count);
  relight(factors, plate, frame, count,
          {&row.colour[0][first], &row.colour[1][first], &row.colour[2][first]});
  std::copy_n(factors.from_plate, count, &row.colour[3][first]);
  for (int k = 0; k < count; ++k) {
    const Provenance revealed = invented[k] != 0 ? kInvented : kSeenElsewhere;
    row.source[first + k] = factors.from_plate[k] > 0.5f ? revealed : kRendered;
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
  if (!frame_.objects[slot].isAtRestInVideo() || frame_.objects[slot].look.albedo ||
      screenAt(u, v) > 0.0f)
    return;
  const Eigen::Vector2f moved = frame_.movement(id, static_cast<float>(u), static_cast<float>(v));
  addResidual(u - moved.x(), v - moved.y(), moved, frame_.objects[slot].surface,
              frame_.objects[slot].tint(), out);
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
      const int first = i,
                limit = std::min(region_.width,
                                 (u / SurfaceRun::kMost + 1) * SurfaceRun::kMost - region_.x);
      i = first + countOfFirst(ids + first,
                               nextUnmarked(row.kinds.data(), i, limit, kPlain | kPlainEdge) - i);
      drawStretch(v, first, i, VisibilityBuffer::objectOf(ids[first]), row);
    } else if (row.kinds[i] == kBehind) {
      const int first = i;
      i = nextUnmarked(row.kinds.data(), i, region_.width, kBehind);
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
  const cv::Vec3b* frame = frame_.input.bgr.ptr<cv::Vec3b>(v) + region_.x;
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
    i = nextUnmarked(source, i, region_.width, 0xff);
    codec_.encode({&row.colour[0][first], &row.colour[1][first], &row.colour[2][first],
                   &row.colour[3][first]},
                  region_.x + first, v, i - first, codes + first);
  }
  std::memcpy(out.provenance.ptr<std::uint8_t>(v) + region_.x, source, row.source.size());
}

}  // namespace calipso::render

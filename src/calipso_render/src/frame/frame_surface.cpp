// The part of FrameCompositor that lights and shades the drawn surfaces: stretches of pixels that
// see one object by their triangles' maps, other places one by one. Where the sun changes
// little between the corners of small squares it is interpolated, elsewhere looked up at the pixel.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>

#include "draw/eight_lanes.hpp"
#include "draw/kernels.hpp"
#include "frame/frame_compositor.hpp"
#include "frame/marked.hpp"

namespace calipso::render {
namespace {

// of visibility: between corners that differ by no more it is interpolated
constexpr float kEvenSun = 0.12f, kEvenSunOfTwo = 0.06f;  // likewise over two steps

void copyTo(float (&to)[3], const cv::Vec3f& from) { std::copy_n(from.val, 3, to); }

int toMultiple(int pixel, int step) { return pixel / step * step; }

}  // namespace

// Light and look of every slot, laid out for the shading of many points.
void FrameCompositor::shadeSetup() {
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot) {
    const Appearance& appearance = frame_.prepared.appearances[frame_.objects[slot].surface];
    SurfaceShade s;
    Eigen::Map<Eigen::Vector3f>(s.direction) = frame_.light.direction;
    copyTo(s.sun, frame_.light.sun), copyTo(s.least, 0.02f * frame_.light.ambient[0]);
    s.terms = 1;
    for (int i = 0; i < 9; ++i) {
      copyTo(s.ambient[i], frame_.light.ambient[i]);
      if (frame_.light.ambient[i] != cv::Vec3f()) s.terms = i == 0 ? 1 : i < 4 ? 4 : 9;
    }
    copyTo(s.floor, lightFloor(appearance.mean_light));
    copyTo(s.tint, frame_.objects[slot].tint());
    s.specular = frame_.objects[slot].gloss.specular,
    s.roughness = frame_.objects[slot].gloss.roughness;
    s.around = frame_.objects[slot].gloss.around;
    shades_.push_back(s);
  }
}

// What edited objects and others leave of the sun.
void FrameCompositor::sunOn(const LightBatch& points, float* sun) const {
  points.look(*moved_shadow_, sun);
  if (shadows_.others->empty()) return;
  float others[LightBatch::kMost];
  points.look(*shadows_.others, others);
  for (int k = 0; k < points.count(); ++k) sun[k] *= others[k];
}

// Looks the sun up at some places of a run; those that face away from it get none.
// @param nearness of the run's places along their sight lines of depth 1, 1/m; null: the lines end
// at the places
void FrameCompositor::sunOnPlaces(const int* places, int count, const float* nearness,
                                  SurfaceRun& run) const {
  LightBatch facing;
  int numbers[SurfaceRun::kRoom];
  for (int k = 0; k < count; ++k) {
    const int i = places[k];
    const Eigen::Vector3f n(run.normal[0][i], run.normal[1][i], run.normal[2][i]),
        sight(run.sight[0][i], run.sight[1][i], run.sight[2][i]);
    run.sun[i] = 0.0f;
    if (n.dot(frame_.light.direction) <= 0.0f) continue;
    numbers[facing.add(frame_.eye + sight * (nearness != nullptr ? 1.0f / nearness[i] : 1.0f), n)] =
        i;
  }
  float sun[LightBatch::kMost];
  sunOn(facing, sun);
  for (int k = 0; k < facing.count(); ++k) run.sun[numbers[k]] = sun[k];
}

// The sun at the corners and in the middles of squares of two steps, then at the places on their
// sides where it does not follow from those.
void FrameCompositor::findSurfaceSun() {
  shadeSetup();
  sun_origin_ = {toMultiple(region_.x, 2 * kLightStep), toMultiple(region_.y, 2 * kLightStep)};
  sun_columns_ = ((region_.br().x - sun_origin_.x) / kLightStep + 2) | 1;
  sun_rows_ = ((region_.br().y - sun_origin_.y) / kLightStep + 2) | 1;
  sun_corners_.assign(static_cast<std::size_t>(sun_columns_) * sun_rows_, {});
  smooth_.assign(sun_corners_.size(), 0);
  std::vector<std::uint8_t> large(smooth_.size(),
                                  0);  // squares of two steps, by their first corner
#pragma omp parallel
  {
#pragma omp for schedule(dynamic, 4)
    for (int j = 0; j < sun_rows_; ++j) lightCorners(j, j % 2, {});
#pragma omp for schedule(static)
    for (int j = 0; j < sun_rows_ - 2; j += 2) {
      for (int i = 0; i + 2 < sun_columns_; i += 2)
        large[cornerAt(i, j)] = isSmooth(i, j, 2) ? 1 : 0;
    }
#pragma omp for schedule(dynamic, 4)
    for (int j = 0; j < sun_rows_; ++j) lightCorners(j, 1 - j % 2, large);
#pragma omp for schedule(static)
    for (int j = 0; j < sun_rows_ - 1; ++j) {
      for (int i = 0; i + 1 < sun_columns_; ++i)
        smooth_[cornerAt(i, j)] = isSmooth(i, j, 1) ? 1 : 0;
    }
  }
}

// Every second corner of row j, from column `first` on, that a drawn surface is seen at.
// @param large squares of two steps that are smooth: on a side between two of them the sun is the
// mean of the side's ends; empty: it is looked up everywhere
void FrameCompositor::lightCorners(int j, int first, const std::vector<std::uint8_t>& large) {
  const int v = sun_origin_.y + j * kLightStep;
  if (v < region_.y || v >= region_.br().y) return;
  const std::uint32_t* ids = centre_->ids(v - region_.y);
  const float* nearness = centre_->nearness(v - region_.y);
  SunCorner* corners = &sun_corners_[cornerAt(0, j)];
  const auto slotAt = [&](int i) {
    const int u = sun_origin_.x + i * kLightStep;
    if (u < region_.x || u >= region_.br().x) return -1;
    const std::uint32_t id = ids[u - region_.x];
    if (!isDrawn(id, u, v)) return -1;
    const int slot = VisibilityBuffer::objectOf(id);
    return maps_[slot].of(VisibilityBuffer::triangleOf(id)).is(TriangleMap::kThin) ? -1 : slot;
  };
  CornerRun wanted;
  wanted.count = 0;
  for (int i = first; i < sun_columns_; i += 2) {
    const int slot = slotAt(i), column = sun_origin_.x + i * kLightStep - region_.x;
    if (slot < 0) continue;
    corners[i] = {0.0f, nearness[column], slot};
    const int to_end = j % 2 == 0 ? 1 : sun_columns_;
    if (!large.empty() && isSmoothAround(i, j, large) && corners[i - to_end].slot == slot) {
      corners[i].sun = 0.5f * (corners[i - to_end].sun + corners[i + to_end].sun);
      continue;
    }
    if (wanted.count == SurfaceRun::kMost || (wanted.count > 0 && slot != wanted.slot))
      lookUp(v, wanted, corners);
    wanted.slot = slot;
    wanted.run.column[wanted.count] = static_cast<float>(column + region_.x);
    wanted.ids[wanted.count] = ids[column], wanted.corners[wanted.count++] = i;
  }
  lookUp(v, wanted, corners);
}

// The sun at corners of row v, all of one object.
void FrameCompositor::lookUp(int v, CornerRun& wanted, SunCorner* corners) const {
  if (wanted.count == 0) return;
  float nearness[SurfaceRun::kRoom];
  int places[SurfaceRun::kMost];
  for (int k = 0; k < wanted.count; ++k)
    places[k] = k, nearness[k] = corners[wanted.corners[k]].nearness;
  kernels().locate(maps_[wanted.slot].triangles(), wanted.ids, {v, wanted.count, 0, cv::Point()},
                   place_.view.planes().sightLines(v), wanted.run);
  sunOnPlaces(places, wanted.count, nearness, wanted.run);
  for (int k = 0; k < wanted.count; ++k) corners[wanted.corners[k]].sun = wanted.run.sun[k];
  wanted.count = 0;
}

// Are the squares of two steps smooth that a place on their sides lies between?
bool FrameCompositor::isSmoothAround(int i, int j, const std::vector<std::uint8_t>& large) const {
  const bool level = j % 2 == 0;  // it lies between a left and a right corner
  const int column = i / 2 * 2, row = j / 2 * 2;
  const auto isLarge = [&](int x, int y) {
    return x < 0 || y < 0 || x + 2 >= sun_columns_ || y + 2 >= sun_rows_ ||
           large[cornerAt(x, y)] != 0;
  };
  return isLarge(column, row) && (level ? isLarge(column, row - 2) : isLarge(column - 2, row)) &&
         i > 0 && j > 0 && i + 1 < sun_columns_ && j + 1 < sun_rows_;
}

// Where the sun on a place of one object follows from the corners around: that.
std::optional<float> FrameCompositor::sunBetween(float u, float v, float nearness, int slot) const {
  const float x = (u - static_cast<float>(sun_origin_.x)) / kLightStep,
              y = (v - static_cast<float>(sun_origin_.y)) / kLightStep;
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  if (!(x >= 0.0f && y >= 0.0f) || i + 1 >= sun_columns_ || j + 1 >= sun_rows_) return std::nullopt;
  const SunCorner *a = &sun_corners_[cornerAt(i, j)], *b = a + sun_columns_;
  if (smooth_[cornerAt(i, j)] == 0 || a->slot != slot) return std::nullopt;
  const float fx = x - static_cast<float>(i), fy = y - static_cast<float>(j);
  const auto between = [&](float SunCorner::*value) {
    const float above = a->*value + fx * (a[1].*value - a->*value),
                below = b->*value + fx * (b[1].*value - b->*value);
    return above + fy * (below - above);
  };
  const float tolerance = kLightStep / static_cast<float>(frame_.input.camera.fx);
  if (!(std::abs(nearness - between(&SunCorner::nearness)) <= tolerance * nearness))
    return std::nullopt;
  return between(&SunCorner::sun);
}

// Does the sun in a square of `size` steps follow from that at its corners? They have to lie on one
// piece of surface; the middle of two steps, which has been looked up, has to agree.
bool FrameCompositor::isSmooth(int i, int j, int size) const {
  const SunCorner* first = &sun_corners_[cornerAt(i, j)];
  const int down = size * sun_columns_;
  const SunCorner &a = first[0], &b = first[size], &c = first[down], &d = first[down + size];
  if (a.slot < 0 || a.slot != b.slot || a.slot != c.slot || a.slot != d.slot) return false;
  if (std::abs(a.nearness + d.nearness - b.nearness - c.nearness) * frame_.input.camera.fx >
      kLightStep * a.nearness)
    return false;
  auto [low, high] = std::minmax({a.sun, b.sun, c.sun, d.sun});
  if (size == 1) return high - low <= kEvenSun;
  const SunCorner& middle = first[sun_columns_ + 1];
  return middle.slot == a.slot &&
         std::max(high, middle.sun) - std::min(low, middle.sun) <= kEvenSunOfTwo;
}

// Reflectance of the pixels [first, last) of row v at their places in row.run.
// @param traits of their triangles
void FrameCompositor::reflectStretch(unsigned traits, int v, int first, int last, int slot,
                                     Row& row) const {
  const int offset = (first + region_.x) % kLightStep;
  const std::optional<cv::Vec3f>& albedo = frame_.objects[slot].look.albedo;
  SurfaceRun& run = row.run;
  if (albedo) {
    for (int c = 0; c < 3; ++c) std::fill_n(&run.colour[c][offset], last - first, (*albedo)[c]);
    return;
  }
  const Appearance& appearance = frame_.prepared.appearances[frame_.objects[slot].surface];
  if ((traits & TriangleMap::kPictured) != 0)
    kernels().sample(appearance.albedo, offset, offset + last - first, run);
  if ((traits & TriangleMap::kTextured) != 0) addTexture(v, first, last, slot, row);
}

// What the texture says of their reflectance.
void FrameCompositor::addTexture(int v, int first, int last, int slot, Row& row) const {
  const SurfaceTexture& texture = frame_.prepared.appearances[frame_.objects[slot].surface].texture;
  const int offset = (first + region_.x) % kLightStep;
  const std::uint32_t* ids = centre_->ids(v - region_.y);
  for (int i = first; i < last; ++i) {
    const int triangle = VisibilityBuffer::triangleOf(ids[i]);
    const TriangleMap& map = maps_[slot].of(triangle);
    if (!map.is(TriangleMap::kTextured) || map.is(TriangleMap::kThin)) continue;
    const Eigen::Vector3f weights =
        barycentric(frame_.objects[slot].actor.screen, triangle, static_cast<float>(i + region_.x),
                    static_cast<float>(v));
    row.run.mix(offset + i - first, texture.at(triangle, weights), map.is(TriangleMap::kPictured));
  }
}

// The sun on the same pixels.
void FrameCompositor::sunOnStretch(int v, int first, int last, int slot, Row& row) const {
  const int offset = (first + region_.x) % kLightStep, base = first - offset;
  const int j = (v - sun_origin_.y) / kLightStep;
  const float down = static_cast<float>((v - sun_origin_.y) % kLightStep) / kLightStep,
              tolerance = kLightStep / static_cast<float>(frame_.input.camera.fx);
  const float* nearness = centre_->nearness(v - region_.y);
  SurfaceRun& run = row.run;
  float near[SurfaceRun::kRoom] = {};
  std::copy_n(&nearness[first], last - first, &near[offset]);
  const Four parts = {0.0f, 0.25f, 0.5f, 0.75f};
  static_assert(kLightStep == 4);
  int uneven[SurfaceRun::kRoom], count = 0;
  std::size_t square =
      static_cast<std::size_t>(j) * sun_columns_ + (base + region_.x - sun_origin_.x) / kLightStep;
  for (int k = 0; k < offset + last - first; k += kLightStep, ++square) {
    const int begin = std::max(k, offset), end = std::min(k + kLightStep, offset + last - first);
    const SunCorner *a = &sun_corners_[square], *b = a + sun_columns_;
    if (smooth_[square] == 0 || a->slot != slot) {
      for (int i = begin; i < end; ++i) {
        if (row.kinds[base + i] != kPlainEdge) uneven[count++] = i;
      }
      continue;
    }
    const auto between = [&](float x, float y) { return x + down * (y - x); };
    const float sun = between(a->sun, b->sun), sun_rise = between(a[1].sun, b[1].sun) - sun,
                from = between(a->nearness, b->nearness),
                rise = between(a[1].nearness, b[1].nearness) - from;
    *reinterpret_cast<Four*>(run.sun + k) = sun + parts * sun_rise;
    // Another piece of the surface can look out between the corners.
    const Four here = fourAt(near + k), off = here - (from + parts * rise), most = tolerance * here;
    const FourInts other = (off > most) | (-off > most);
    for (int i = begin; i < end; ++i) {
      if (other[i - k] != 0) uneven[count++] = i;
    }
  }
  sunOnPlaces(uneven, count, near, run);
}

// Pixels [first, last) of row v, all of which see the object in `slot` and nothing of what lies
// behind. @pre they lie within SurfaceRun::kMost px that start at a multiple of kLightStep
void FrameCompositor::drawStretch(int v, int first, int last, int slot, Row& row) const {
  const std::uint32_t* ids = centre_->ids(v - region_.y);
  const int offset = (first + region_.x) % kLightStep, count = last - first;
  SurfaceRun& run = row.run;
  std::iota(run.column + offset, run.column + offset + count,
            static_cast<float>(first + region_.x));
  const unsigned traits = kernels().locate(
      maps_[slot].triangles(), ids + first,
      {v, count, offset, frame_.prepared.appearances[frame_.objects[slot].surface].region.tl()},
      place_.view.planes().sightLines(v), run);
  reflectStretch(traits, v, first, last, slot, row);
  sunOnStretch(v, first, last, slot, row);
  kernels().shade(shades_[slot], offset, offset + count, run);
  for (int c = 0; c < 3; ++c) std::copy_n(&run.colour[c][offset], count, &row.colour[c][first]);
  std::fill_n(&row.colour[3][first], count, 1.0f);
  for (int i = nextMarked(row.kinds.data(), first, last, kPlainEdge); i < last;
       i = nextMarked(row.kinds.data(), i + 1, last, kPlainEdge)) {
    const cv::Vec3f& c = row.drawn[i].colour;
    row.set(i, {c[0], c[1], c[2], 1.0f});
  }
  std::memset(&row.source[first], kRendered, count);
  carryResidual(v, first, last, slot, row);
  for (int i = first; (traits & TriangleMap::kThin) != 0 && i < last; ++i) {
    if (!maps_[slot].of(VisibilityBuffer::triangleOf(ids[i])).is(TriangleMap::kThin)) continue;
    const SurfacePlace place{ids[i], static_cast<float>(i + region_.x), static_cast<float>(v)};
    shadePlaces(&place, 1, slot, run);
    row.set(i, {run.colour[0][0], run.colour[1][0], run.colour[2][0], 1.0f});
  }
}

// What drawing misses of the video goes along with pixels that have moved little.
void FrameCompositor::carryResidual(int v, int first, int last, int slot, Row& row) const {
  if (miss_.empty() || !frame_.objects[slot].isAtRestInVideo() || frame_.objects[slot].look.albedo)
    return;
  const int surface = frame_.objects[slot].surface, offset = (first + region_.x) % kLightStep;
  const cv::Point corner = frame_.prepared.appearances[surface].region.tl();
  for (int i = first; i < last; ++i) {
    const float u = static_cast<float>(i + region_.x),
                from_u = row.run.key_u[offset + i - first] + static_cast<float>(corner.x),
                from_v = row.run.key_v[offset + i - first] + static_cast<float>(corner.y);
    const Eigen::Vector2f moved(u - from_u, static_cast<float>(v) - from_v);
    if (!(moved.squaredNorm() < kNonePx * kNonePx)) continue;
    cv::Vec4f colour = row.at(i);
    addResidual(from_u, from_v, moved, surface, frame_.objects[slot].tint(), colour);
    row.set(i, colour);
  }
}

// Radiance of places of one object.
// @param count at most SurfaceRun::kMost
void FrameCompositor::shadePlaces(const SurfacePlace* places, int count, int slot,
                                  SurfaceRun& run) const {
  const Appearance& appearance = frame_.prepared.appearances[frame_.objects[slot].surface];
  Eigen::Vector3f weights[SurfaceRun::kMost];
  maps_[slot].locate(places, count, run, weights);
  const std::optional<cv::Vec3f>& albedo = frame_.objects[slot].look.albedo;
  if (!albedo) kernels().sample(appearance.albedo, 0, count, run);
  const Eigen::Vector3f axis = frame_.input.camera.world_from_camera.linear().col(2).cast<float>();
  int uneven[SurfaceRun::kMost], found = 0;
  for (int k = 0; k < count; ++k) {
    const int triangle = VisibilityBuffer::triangleOf(places[k].id);
    const Appearance::Source source = appearance.sources[triangle];
    if (albedo)
      run.mix(k, cv::Vec4f((*albedo)[0], (*albedo)[1], (*albedo)[2]), false);
    else if (source != Appearance::Source::kPicture)
      run.mix(k, appearance.texture.at(triangle, weights[k]), source == Appearance::Source::kBoth);
    const float depth =
        axis.x() * run.sight[0][k] + axis.y() * run.sight[1][k] + axis.z() * run.sight[2][k];
    const auto sun = sunBetween(places[k].u, places[k].v, 1.0f / depth, slot);
    run.sun[k] = sun.value_or(0.0f);
    if (!sun) uneven[found++] = k;
  }
  sunOnPlaces(uneven, found, nullptr, run);
  kernels().shade(shades_[slot], 0, count, run);
}

}  // namespace calipso::render

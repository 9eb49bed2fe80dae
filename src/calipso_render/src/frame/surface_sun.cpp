#include "frame/surface_sun.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "draw/eight_lanes.hpp"
#include "draw/kernels.hpp"

namespace calipso::render {
namespace {

// of visibility: between corners that differ by no more it is interpolated
constexpr float kEvenSun = 0.12f, kEvenSunOfTwo = 0.06f;  // likewise over two steps

int toMultiple(int pixel, int step) { return pixel / step * step; }

}  // namespace

SurfaceSun::SurfaceSun(const StagedFrame& frame, const PlaneView& planes,
                       const DrawnSurfaces& surfaces, const std::vector<SurfaceMaps>& maps,
                       const MovedShadow& moved, const RestingLight& resting)
    : frame_(frame),
      planes_(planes),
      surfaces_(surfaces),
      maps_(maps),
      moved_(moved),
      resting_(resting),
      region_(surfaces.centre().region()) {
  find();
}

// The sun at the corners and in the middles of squares of two steps, then at the places on their
// sides where it does not follow from those.
void SurfaceSun::find() {
  origin_ = {toMultiple(region_.x, 2 * kLightStep), toMultiple(region_.y, 2 * kLightStep)};
  columns_ = ((region_.br().x - origin_.x) / kLightStep + 2) | 1;
  rows_ = ((region_.br().y - origin_.y) / kLightStep + 2) | 1;
  corners_.assign(static_cast<std::size_t>(columns_) * rows_, {});
  smooth_.assign(corners_.size(), 0);
  std::vector<std::uint8_t> large(smooth_.size(),
                                  0);  // squares of two steps, by their first corner
#pragma omp parallel
  {
#pragma omp for schedule(dynamic, 4)
    for (int j = 0; j < rows_; ++j) lightCorners(j, j % 2, {});
#pragma omp for schedule(static)
    for (int j = 0; j < rows_ - 2; j += 2) {
      for (int i = 0; i + 2 < columns_; i += 2) large[cornerAt(i, j)] = isSmooth(i, j, 2) ? 1 : 0;
    }
#pragma omp for schedule(dynamic, 4)
    for (int j = 0; j < rows_; ++j) lightCorners(j, 1 - j % 2, large);
#pragma omp for schedule(static)
    for (int j = 0; j < rows_ - 1; ++j) {
      for (int i = 0; i + 1 < columns_; ++i) smooth_[cornerAt(i, j)] = isSmooth(i, j, 1) ? 1 : 0;
    }
  }
}

// Every second corner of row j, from column `first` on, that a drawn surface is seen at.
// @param large squares of two steps that are smooth: on a side between two of them the sun is the
// mean of the side's ends; empty: it is looked up everywhere
void SurfaceSun::lightCorners(int j, int first, const std::vector<std::uint8_t>& large) {
  const int v = origin_.y + j * kLightStep;
  if (v < region_.y || v >= region_.br().y) return;
  const std::uint32_t* ids = surfaces_.centre().ids(v - region_.y);
  const float* nearness = surfaces_.centre().nearness(v - region_.y);
  Corner* corners = &corners_[cornerAt(0, j)];
  CornerRun wanted;
  wanted.count = 0;
  for (int i = first; i < columns_; i += 2) {
    const int slot = slotAt(i, v, ids), column = origin_.x + i * kLightStep - region_.x;
    if (slot < 0) continue;
    corners[i] = {0.0f, nearness[column], slot};
    const int to_end = j % 2 == 0 ? 1 : columns_;
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

// Which object's surface is lit at corner i of picture row v; -1: none. @param ids of the row
int SurfaceSun::slotAt(int i, int v, const std::uint32_t* ids) const {
  const int u = origin_.x + i * kLightStep;
  if (u < region_.x || u >= region_.br().x) return -1;
  const std::uint32_t id = ids[u - region_.x];
  return surfaces_.isDrawn(id, u, v) ? VisibilityBuffer::objectOf(id) : -1;
}

// The sun at corners of row v, all of one object.
void SurfaceSun::lookUp(int v, CornerRun& wanted, Corner* corners) const {
  if (wanted.count == 0) return;
  const SurfaceMaps& maps = maps_[wanted.slot];
  const unsigned traits =
      kernels().locate(maps.triangles(), wanted.ids, {v, wanted.count, 0, cv::Point()},
                       planes_.sightLines(v), wanted.run);
  int places[SurfaceRun::kMost];
  std::iota(places, places + wanted.count, 0);
  onPlaces(places, wanted.count, wanted.run.nearness, wanted.run);
  for (int k = 0; k < wanted.count; ++k) corners[wanted.corners[k]].sun = wanted.run.sun[k];
  for (int k = 0; k < wanted.count && (traits & TriangleMap::kThin) != 0; ++k) {
    if (maps.of(VisibilityBuffer::triangleOf(wanted.ids[k])).is(TriangleMap::kThin))
      corners[wanted.corners[k]].slot = -1;
  }
  wanted.count = 0;
}

// Are the squares of two steps smooth that a place on their sides lies between?
bool SurfaceSun::isSmoothAround(int i, int j, const std::vector<std::uint8_t>& large) const {
  const bool level = j % 2 == 0;  // it lies between a left and a right corner
  const int column = i / 2 * 2, row = j / 2 * 2;
  const auto isLarge = [&](int x, int y) {
    return x < 0 || y < 0 || x + 2 >= columns_ || y + 2 >= rows_ || large[cornerAt(x, y)] != 0;
  };
  return isLarge(column, row) && (level ? isLarge(column, row - 2) : isLarge(column - 2, row)) &&
         i > 0 && j > 0 && i + 1 < columns_ && j + 1 < rows_;
}

// Does the sun in a square of `size` steps follow from that at its corners? They have to lie on one
// piece of surface; the middle of two steps, which has been looked up, has to agree.
bool SurfaceSun::isSmooth(int i, int j, int size) const {
  const Corner* first = &corners_[cornerAt(i, j)];
  const int down = size * columns_;
  const Corner &a = first[0], &b = first[size], &c = first[down], &d = first[down + size];
  if (a.slot < 0 || a.slot != b.slot || a.slot != c.slot || a.slot != d.slot) return false;
  if (std::abs(a.nearness + d.nearness - b.nearness - c.nearness) * frame_.input.camera.fx >
      kLightStep * a.nearness)
    return false;
  auto [low, high] = std::minmax({a.sun, b.sun, c.sun, d.sun});
  if (size == 1) return high - low <= kEvenSun;
  const Corner& middle = first[columns_ + 1];
  return middle.slot == a.slot &&
         std::max(high, middle.sun) - std::min(low, middle.sun) <= kEvenSunOfTwo;
}

std::optional<float> SurfaceSun::between(float u, float v, float nearness, int slot) const {
  const float x = (u - static_cast<float>(origin_.x)) / kLightStep,
              y = (v - static_cast<float>(origin_.y)) / kLightStep;
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  if (!(x >= 0.0f && y >= 0.0f) || i + 1 >= columns_ || j + 1 >= rows_) return std::nullopt;
  const Corner *a = &corners_[cornerAt(i, j)], *b = a + columns_;
  if (smooth_[cornerAt(i, j)] == 0 || a->slot != slot) return std::nullopt;
  const float fx = x - static_cast<float>(i), fy = y - static_cast<float>(j);
  const auto between = [&](float Corner::*value) {
    const float above = a->*value + fx * (a[1].*value - a->*value),
                below = b->*value + fx * (b[1].*value - b->*value);
    return above + fy * (below - above);
  };
  const float tolerance = kLightStep / static_cast<float>(frame_.input.camera.fx);
  if (!(std::abs(nearness - between(&Corner::nearness)) <= tolerance * nearness))
    return std::nullopt;
  return between(&Corner::sun);
}

// What edited objects, others and what no frame shows leave of the sun.
void SurfaceSun::lookAt(const LightBatch& points, float* sun) const {
  points.look(*moved_.sun, sun);
  multiplyBy(resting_.others(), points, sun);
  if (frame_.hasSunOfVideo()) multiplyBy(frame_.prepared.unseen_shade, points, sun);
}

void SurfaceSun::onPlaces(const int* places, int count, const float* nearness,
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
  lookAt(facing, sun);
  for (int k = 0; k < facing.count(); ++k) run.sun[numbers[k]] = sun[k];
}

void SurfaceSun::onStretch(int v, int first, int last, int slot, Row& row) const {
  const int offset = (first + region_.x) % kLightStep, base = first - offset;
  const int j = (v - origin_.y) / kLightStep;
  const float down = static_cast<float>((v - origin_.y) % kLightStep) / kLightStep,
              tolerance = kLightStep / static_cast<float>(frame_.input.camera.fx);
  SurfaceRun& run = row.run;
  const Four parts = {0.0f, 0.25f, 0.5f, 0.75f};
  static_assert(kLightStep == 4);
  int uneven[SurfaceRun::kRoom], count = 0;
  std::size_t square =
      static_cast<std::size_t>(j) * columns_ + (base + region_.x - origin_.x) / kLightStep;
  for (int k = 0; k < offset + last - first; k += kLightStep, ++square) {
    const int begin = std::max(k, offset), end = std::min(k + kLightStep, offset + last - first);
    const Corner *a = &corners_[square], *b = a + columns_;
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
    const Four here = fourAt(run.nearness + k), off = here - (from + parts * rise),
               most = tolerance * here;
    const FourInts other = (off > most) | (-off > most);
    if (!any(other)) continue;
    for (int i = begin; i < end; ++i) {
      if (other[i - k] != 0) uneven[count++] = i;
    }
  }
  onPlaces(uneven, count, run.nearness, run);
}

}  // namespace calipso::render

// The part of FrameCompositor that lights the drawn surfaces.

#include <algorithm>
#include <cmath>

#include "frame_compositor.hpp"

namespace calipso::render {
namespace {

// of the light: between corners that differ by no more it is interpolated
constexpr float kEvenLight = 0.06f;
constexpr float kSmoothLight = 0.015f;  // likewise where the light in their middle is their mean
                                        // but for this; half of it over two steps

}  // namespace

const Look& FrameCompositor::lookOf(int slot) const {
  static const Look as_it_is;
  const ObjectInFrame* state = states_[surface_of_slot_[slot]];
  return state != nullptr ? state->look : as_it_is;
}

FrameCompositor::Lit FrameCompositor::exactLight(const LitPoint& p, int slot) const {
  const float sun = p.normal.dot(light_.direction) > 0.0f ? newSun(p.position, p.normal) : 0.0f;
  const PointLight::Shading shading =
      point_light_.at(glosses_[slot], prepared_.appearances[surface_of_slot_[slot]].tint, p.normal,
                      (eye_ - p.position).normalized(), sun, p.sky);
  return {shading.diffuse, shading.highlight, slot};
}

// Light at the corners of small squares; where a smooth piece of surface fills a square and the
// light changes little over it, the points between take it from the corners. Squares of twice the
// side are tried first.
void FrameCompositor::findSurfaceLight() {
  const int columns = (region_.width / kLightStep + 3) | 1,
            rows = (region_.height / kLightStep + 3) | 1;
  lit_.assign(static_cast<std::size_t>(columns) * rows, {});
  smooth_.assign(lit_.size(), 0);
  lit_columns_ = columns, lit_rows_ = rows;
  const int across = columns / 2;
  std::vector<std::uint8_t> smooth(static_cast<std::size_t>(across) *
                                   (rows / 2));  // per large square
#pragma omp parallel
  {
// Corners and middles of large squares.
#pragma omp for schedule(dynamic, 4)
    for (int j = 0; j < rows; ++j) {
      for (int i = j % 2; i < columns; i += 2) lightCorner(i, j);
    }
#pragma omp for schedule(dynamic, 4)
    for (int j = 0; j < rows / 2; ++j) {
      for (int i = 0; i < across; ++i)
        smooth[static_cast<std::size_t>(j) * across + i] = isSmooth(2 * i, 2 * j, 2) ? 1 : 0;
    }
    const auto isLarge = [&](int i, int j) {
      return i < 0 || j < 0 || i >= across || j >= rows / 2 ||
             smooth[static_cast<std::size_t>(j) * across + i] != 0;
    };
    // The places on their sides.
#pragma omp for schedule(dynamic, 4)
    for (int j = 0; j < rows; ++j) {
      for (int i = 1 - j % 2; i < columns; i += 2) {
        const bool follows = isLarge(i / 2, j / 2) &&
                             (j % 2 == 0 ? isLarge(i / 2, j / 2 - 1) : isLarge(i / 2 - 1, j / 2));
        if (follows)
          interpolateCorner(i, j);
        else
          lightCorner(i, j);
      }
    }
#pragma omp for schedule(dynamic, 4)
    for (int j = 0; j < rows - 1; ++j) {
      for (int i = 0; i + 1 < columns; ++i)
        smooth_[static_cast<std::size_t>(j) * columns + i] =
            smooth[static_cast<std::size_t>(j / 2) * across + i / 2] != 0 || isSmooth(i, j, 1) ? 1
                                                                                               : 0;
    }
  }
}

void FrameCompositor::lightCorner(int i, int j) {
  lit_[static_cast<std::size_t>(j) * lit_columns_ + i] =
      lightAt(region_.x + i * kLightStep, region_.y + j * kLightStep);
}

FrameCompositor::Lit FrameCompositor::lightAt(int u, int v) const {
  const std::uint32_t id = centre_->idAt(u, v);
  if (!region_.contains({u, v}) || !isDrawn(id, u, v)) return {};
  const int slot = VisibilityBuffer::objectOf(id);
  Lit lit = exactLight(litPoint(actors_[slot], VisibilityBuffer::triangleOf(id),
                                static_cast<float>(u), static_cast<float>(v), eye_),
                       slot);
  lit.diffuse[3] = centre_->nearnessAt(u, v);
  return lit;
}

// On a side of large squares that are smooth.
void FrameCompositor::interpolateCorner(int i, int j) {
  Lit* lit = &lit_[static_cast<std::size_t>(j) * lit_columns_ + i];
  const std::ptrdiff_t to_end = i % 2 == 1 ? 1 : lit_columns_;
  const Lit &a = lit[-to_end], &b = lit[to_end];
  *lit = {0.5f * (a.diffuse + b.diffuse), 0.5f * (a.highlight + b.highlight), a.slot};
}

// Does the light in a square of `size` steps follow from that at its corners? Where they differ,
// its middle has to agree.
bool FrameCompositor::isSmooth(int i, int j, int size) const {
  const Lit* first = &lit_[static_cast<std::size_t>(j) * lit_columns_ + i];
  const std::size_t down = static_cast<std::size_t>(size) * lit_columns_;
  const Lit &a = first[0], &b = first[size], &c = first[down], &d = first[down + size];
  if (a.slot < 0 || a.slot != b.slot || a.slot != c.slot || a.slot != d.slot) return false;
  if (std::abs(a.diffuse[3] + d.diffuse[3] - b.diffuse[3] - c.diffuse[3]) * frame_.camera.fx >
      kLightStep * a.diffuse[3])
    return false;
  cv::Vec4f mean;
  bool even = size == 1;
  float highest[3];
  for (int k = 0; k < 3; ++k) {
    const float all[] = {a.diffuse[k] + a.highlight[k], b.diffuse[k] + b.highlight[k],
                         c.diffuse[k] + c.highlight[k], d.diffuse[k] + d.highlight[k]};
    const auto [low, high] = std::minmax_element(std::begin(all), std::end(all));
    mean[k] = 0.25f * (all[0] + all[1] + all[2] + all[3]), highest[k] = *high;
    even = even && *high - *low <= kEvenLight * *high;
  }
  if (even) return true;
  const Lit middle = size == 2 ? first[lit_columns_ + 1]
                               : lightAt(region_.x + i * kLightStep + kLightStep / 2,
                                         region_.y + j * kLightStep + kLightStep / 2);
  if (middle.slot != a.slot) return false;
  for (int k = 0; k < 3; ++k) {
    if (std::abs(middle.diffuse[k] + middle.highlight[k] - mean[k]) >
        kSmoothLight / static_cast<float>(size) * highest[k])
      return false;
  }
  return true;
}

}  // namespace calipso::render

#include "frame/plane_sky.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "calipso_render/sky_map.hpp"
#include "draw/light_batch.hpp"
#include "draw/wide_loops.hpp"
#include "frame/marked.hpp"
#include "frame/plane_light.hpp"

namespace calipso::render {
namespace {

constexpr int kSteps = 160;  // places along the picture's width
// px between places, at least and at most: what lies within so many of a place that is left out (a
// square and its margin) is left out, too
constexpr int kNearest = 4, kFarthest = 16;
// of the sky's light: between places that differ by no more it is interpolated
constexpr float kSlow = 0.12f;

// Places looked up together; those where no plane is seen get nothing.
template <class Store>
class SkyLookup {
 public:
  SkyLookup(const PlaneView& planes, const Visibility& sky, const Store& store)
      : planes_(planes), sky_(sky), store_(store) {}
  void add(int u, int v, int number) {
    Receiver r;
    if (!planes_.at(u, v, r)) return;
    numbers_[batch_.add(r.position, r.normal)] = number;
    if (batch_.count() == LightBatch::kMost) look();
  }
  void look() {
    float seen[LightBatch::kMost];
    batch_.look(sky_, seen);
    for (int k = 0; k < batch_.count(); ++k) store_(numbers_[k], skyLight(seen[k]));
    batch_.clear();
  }

 private:
  const PlaneView& planes_;
  const Visibility& sky_;
  const Store& store_;
  LightBatch batch_;
  int numbers_[LightBatch::kMost];
};

}  // namespace

SkyGrid::SkyGrid(const PlaneView& planes, const Visibility& sky, const cv::Size& picture,
                 const cv::Rect& region, const SquareMask& skip)
    : step_(std::clamp(picture.width / kSteps, kNearest, kFarthest)),
      first_(region.x / step_, region.y / step_),
      light_((region.br().y - 1) / step_ - first_.y + 2, (region.br().x - 1) / step_ - first_.x + 2,
             CV_32F, cv::Scalar(1.0f)),
      uneven_(cv::Mat::zeros(light_.rows - 1, light_.cols - 1, CV_8U)) {
  if (sky.empty()) return;
#pragma omp parallel
  {
#pragma omp for schedule(dynamic, 2)
    for (int j = 0; j < light_.rows; ++j) measureRow(planes, sky, skip, j);
#pragma omp for schedule(static)
    for (int j = 0; j < uneven_.rows; ++j) {
      for (int i = 0; i < uneven_.cols; ++i)
        uneven_.at<std::uint8_t>(j, i) = isUneven(skip, i, j) ? 255 : 0;
    }
  }
}

void SkyGrid::measureRow(const PlaneView& planes, const Visibility& sky, const SquareMask& skip,
                         int j) {
  float* row = light_.ptr<float>(j);
  const auto store = [row](int i, float light) { row[i] = light; };
  SkyLookup lookup(planes, sky, store);
  const int v = (first_.y + j) * step_;
  for (int i = 0; i < light_.cols; ++i) {
    if (!skip.at((first_.x + i) * step_, v)) lookup.add((first_.x + i) * step_, v, i);
  }
  lookup.look();
}

// What lies beside places that are not wanted is not wanted either.
bool SkyGrid::isUneven(const SquareMask& skip, int i, int j) const {
  const float *above = light_.ptr<float>(j) + i, *below = light_.ptr<float>(j + 1) + i;
  const auto [low, high] = std::minmax({above[0], above[1], below[0], below[1]});
  if (high - low <= kSlow) return false;
  const int u = (first_.x + i) * step_, v = (first_.y + j) * step_;
  return !skip.at(u, v) && !skip.at(u + step_, v) && !skip.at(u, v + step_) &&
         !skip.at(u + step_, v + step_);
}

void SkyGrid::levels(const PlaneView& planes, const Visibility& sky, int v, int begin, int end,
                     std::uint8_t* out) const {
  interpolate(v, begin, end, out);
  const std::uint8_t* uneven = uneven_.ptr<std::uint8_t>(v / step_ - first_.y);
  const auto store = [&](int k, float light) { out[k] = lightLevel(light); };
  SkyLookup lookup(planes, sky, store);
  const int last = (end - 1) / step_ - first_.x + 1;
  for (int i = nextMarked(uneven, begin / step_ - first_.x, last); i < last;
       i = nextMarked(uneven, i + 1, last)) {
    const int left = (first_.x + i) * step_;
    for (int u = std::max(begin, left); u < std::min(end, left + step_); ++u)
      lookup.add(u, v, u - begin);
  }
  lookup.look();
}

CALIPSO_WIDE_LOOPS void SkyGrid::interpolate(int v, int begin, int end, std::uint8_t* out) const {
  const int j = v / step_ - first_.y;
  const float y = static_cast<float>(v % step_) / static_cast<float>(step_);
  const float *above = light_.ptr<float>(j), *below = light_.ptr<float>(j + 1);
  const auto at = [&](int i) { return (1.0f - y) * above[i] + y * below[i]; };
  for (int u = begin; u < end;) {
    const int i = u / step_ - first_.x, corner = (i + first_.x) * step_,
              stop = std::min(end, corner + step_);
    const float left = at(i), rise = (at(i + 1) - left) / static_cast<float>(step_);
    while (u < stop) {
      const EightBytes levels =
          lightLevels(left + rise * (static_cast<float>(u - corner) + lanes()));
      const int count = std::min(8, stop - u);
      if (count == 8)
        std::memcpy(out, &levels, 8);
      else
        std::memcpy(out, &levels, count);
      u += count, out += count;
    }
  }
}

cv::Rect SkyGrid::cellsOf(const cv::Rect& rect) const {
  const cv::Point low(rect.x / step_, rect.y / step_),
      high((rect.br().x - 1) / step_, (rect.br().y - 1) / step_);
  return cv::Rect(low, high + cv::Point(1, 1)) - first_;
}

std::vector<float> SkyGrid::differences(const SkyGrid& other, const cv::Rect& rect) const {
  const cv::Rect cells = cellsOf(rect), others = cells + first_ - other.first_;
  std::vector<float> at_places(cells.width + 1, 0.0f), greatest(cells.width);
  for (int j = 0; j <= cells.height; ++j) {
    const float *here = light_.ptr<float>(cells.y + j) + cells.x,
                *there = other.light_.ptr<float>(others.y + j) + others.x;
    for (int i = 0; i <= cells.width; ++i)
      at_places[i] = std::max(at_places[i], std::abs(here[i] - there[i]));
  }
  for (int i = 0; i < cells.width; ++i) greatest[i] = std::max(at_places[i], at_places[i + 1]);
  for (int j = 0; j < cells.height; ++j) {
    const std::uint8_t *here = uneven_.ptr<std::uint8_t>(cells.y + j) + cells.x,
                       *there = other.uneven_.ptr<std::uint8_t>(others.y + j) + others.x;
    for (int i = 0; i < cells.width; ++i)
      greatest[i] = (here[i] | there[i]) != 0 ? 1.0f : greatest[i];
  }
  return greatest;
}

}  // namespace calipso::render

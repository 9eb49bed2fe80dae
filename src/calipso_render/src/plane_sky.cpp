#include "plane_sky.hpp"

#include <algorithm>
#include <vector>

#include "calipso_render/sky_map.hpp"
#include "light_batch.hpp"
#include "plane_light.hpp"

namespace calipso::render {
namespace {

constexpr int kSteps = 160;  // places along the picture's width
constexpr float kSlow =
    0.12f;  // of the sky's light: between places that differ by no more it is interpolated

class SkyGrid {
 public:
  SkyGrid(const PlaneView& planes, const Visibility& sky, const cv::Size& picture,
          const cv::Rect& region, const SquareMask& skip)
      : planes_(planes),
        sky_(sky),
        region_(region),
        skip_(skip),
        step_(std::max(4, picture.width / kSteps)),
        first_(region.x / step_, region.y / step_),
        grid_((region.br().y - 1) / step_ - first_.y + 2,
              (region.br().x - 1) / step_ - first_.x + 2, CV_32F, cv::Scalar(1.0f)),
        levels_(region.size(), CV_8U) {}

  cv::Mat run() {
#pragma omp parallel for schedule(dynamic, 4)
    for (int j = 0; j < grid_.rows; ++j) measure(j);
#pragma omp parallel for schedule(static)
    for (int v = 0; v < region_.height; ++v) interpolate(v);
#pragma omp parallel for schedule(dynamic, 4)
    for (int j = 0; j < grid_.rows - 1; ++j)
      for (int i = 0; i + 1 < grid_.cols; ++i)
        if (isUneven(i, j)) refine(i, j);
    return levels_;
  }

 private:
  // Places looked up together; those where no plane is seen keep what they have.
  template <class Store>
  void measure(const cv::Point* places, int count, const Store& store) const {
    LightBatch batch;
    int number[LightBatch::kMost];
    Receiver r{Eigen::Vector3f::Zero(), Eigen::Vector3f::Zero()};
    for (int k = 0; k < count; ++k)
      if (planes_.at(places[k].x, places[k].y, r)) number[batch.add(r.position, r.normal)] = k;
    float seen[LightBatch::kMost];
    batch.look(sky_, seen);
    for (int k = 0; k < batch.count(); ++k) store(number[k], skyLight(seen[k]));
  }

  void measure(int j) {
    float* row = grid_.ptr<float>(j);
    const int v = (first_.y + j) * step_;
    for (int begin = 0; begin < grid_.cols; begin += LightBatch::kMost) {
      cv::Point places[LightBatch::kMost];
      int columns[LightBatch::kMost], count = 0;
      for (int i = begin; i < std::min(grid_.cols, begin + LightBatch::kMost); ++i) {
        const int u = (first_.x + i) * step_;
        if (!skip_.at(u, v)) columns[count] = i, places[count++] = {u, v};
      }
      measure(places, count, [&](int k, float light) { row[columns[k]] = light; });
    }
  }

  void interpolate(int v) {
    const int j = (region_.y + v) / step_ - first_.y;
    const float y = static_cast<float>((region_.y + v) % step_) / static_cast<float>(step_);
    const float *above = grid_.ptr<float>(j), *below = grid_.ptr<float>(j + 1);
    const auto at = [&](int i) { return (1.0f - y) * above[i] + y * below[i]; };
    std::uint8_t* out = levels_.ptr<std::uint8_t>(v);
    int u = -(region_.x % step_);  // of the place
    for (int i = 0; i + 1 < grid_.cols; ++i, u += step_) {
      const float left = at(i), rise = (at(i + 1) - left) / static_cast<float>(step_);
      const int begin = std::max(u, 0), end = std::min(u + step_, region_.width);
      if (rise == 0.0f && begin < end)
        std::fill(out + begin, out + end, lightLevel(left));
      else
        for (int x = begin; x < end; ++x)
          out[x] = lightLevel(left + rise * static_cast<float>(x - u));
    }
  }

  bool isUneven(int i, int j) const {
    const float *above = grid_.ptr<float>(j) + i, *below = grid_.ptr<float>(j + 1) + i;
    const auto [low, high] = std::minmax({above[0], above[1], below[0], below[1]});
    return high - low > kSlow;
  }

  void refine(int i, int j) {
    const cv::Rect cell =
        cv::Rect((first_.x + i) * step_, (first_.y + j) * step_, step_, step_) & region_;
    for (int v = cell.y; v < cell.br().y; ++v) {
      std::uint8_t* row = levels_.ptr<std::uint8_t>(v - region_.y) - region_.x;
      for (int begin = cell.x; begin < cell.br().x; begin += LightBatch::kMost) {
        cv::Point places[LightBatch::kMost];
        const int count = std::min(cell.br().x - begin, LightBatch::kMost);
        for (int k = 0; k < count; ++k) places[k] = {begin + k, v};
        measure(places, count, [&](int k, float light) { row[begin + k] = lightLevel(light); });
      }
    }
  }

  const PlaneView& planes_;
  const Visibility& sky_;
  const cv::Rect region_;
  const SquareMask& skip_;
  const int step_;
  const cv::Point first_;  // steps
  cv::Mat grid_;           // CV_32FC1
  cv::Mat levels_;
};

}  // namespace

cv::Mat planesUnderSky(const PlaneView& planes, const Visibility& sky, const cv::Size& picture,
                       const cv::Rect& region, const SquareMask& skip) {
  return SkyGrid(planes, sky, picture, region, skip).run();
}

}  // namespace calipso::render

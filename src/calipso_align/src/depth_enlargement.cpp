#include <algorithm>
#include <cmath>
#include <vector>

#include "calipso_align/depth_image.hpp"

namespace calipso::align {
namespace {

// Whether anything changes between column x and the next one.
std::vector<bool> steps(const cv::Mat1f& depth) {
  std::vector<bool> changes(depth.cols - 1, false);
  for (int y = 0; y < depth.rows; ++y)
    for (int x = 0; x + 1 < depth.cols; ++x)
      if (depth(y, x) != depth(y, x + 1)) changes[x] = true;
  return changes;
}

// Pixel x of an enlarged row shows the source's pixel source(x).
template <class Source>
bool explains(const Source& source, const std::vector<bool>& changes) {
  for (size_t x = 0; x < changes.size(); ++x)
    if (changes[x] && source(x) == source(x + 1)) return false;
  return true;
}

// Of the coarsest row of pixels whose repetition gives these steps, if they are enough to tell.
double repetition(const std::vector<bool>& changes) {
  constexpr double kLargest = 8.0, kSmallest = 1.25;
  const size_t size = changes.size() + 1, count = std::count(changes.begin(), changes.end(), true);
  for (size_t w = static_cast<size_t>(std::ceil(size / kLargest)); w * kSmallest <= size; ++w) {
    if (4 * count < w) break;
    // In integers: as fractions, products that should be whole come out a little less.
    const auto corner = [&](size_t x) { return x * w / size; };
    const auto centre = [&](size_t x) { return (2 * x + 1) * w / (2 * size); };
    // OpenCV's INTER_NEAREST, with its rounding.
    const double inverse = 1.0 / (static_cast<double>(size) / w);
    const auto opencv = [&](size_t x) { return static_cast<size_t>(x * inverse); };
    if (explains(corner, changes) || explains(centre, changes) || explains(opencv, changes))
      return static_cast<double>(size) / w;
  }
  return 1.0;
}

}  // namespace

double enlargement(const cv::Mat1f& depth) {
  if (depth.cols < 2 || depth.rows < 2) return 1.0;
  return std::min(repetition(steps(depth)), repetition(steps(depth.t())));
}

}  // namespace calipso::align

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

// Pixel x of an enlarged row shows the source's pixel floor((x + phase) / factor).
bool explains(double factor, double phase, const std::vector<bool>& changes) {
  const auto source = [&](size_t x) { return std::floor((x + phase) / factor); };
  for (size_t x = 0; x < changes.size(); ++x)
    if (changes[x] && source(x) == source(x + 1)) return false;
  return true;
}

// Of the coarsest row of pixels whose repetition gives these steps, if they are enough to tell.
double repetition(const std::vector<bool>& changes) {
  constexpr double kLargest = 8.0, kSmallest = 1.25;
  const int size = static_cast<int>(changes.size()) + 1;
  const auto count = std::count(changes.begin(), changes.end(), true);
  for (int w = static_cast<int>(std::ceil(size / kLargest)); w * kSmallest <= size; ++w)
    for (const double phase : {0.0, 0.5}) {
      const double factor = static_cast<double>(size) / w;
      if (4 * count >= w && explains(factor, phase, changes)) return factor;
    }
  return 1.0;
}

}  // namespace

double enlargement(const cv::Mat1f& depth) {
  if (depth.cols < 2 || depth.rows < 2) return 1.0;
  return std::min(repetition(steps(depth)), repetition(steps(depth.t())));
}

}  // namespace calipso::align

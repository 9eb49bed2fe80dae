#pragma once

#include <algorithm>
#include <cstddef>

#include "calipso_scene/camera.hpp"

namespace calipso::render {

// Texels of an object: where several frames make them, nothing else is drawn of what these show. Of
// pictures of so many pixels, and of larger ones as many more, but no more than some times as many.
inline std::size_t mostTexels(const Camera& camera, std::size_t views) {
  constexpr std::size_t kMostTexels = 300000, kMostOfSeveral = 600000;
  constexpr double kUsualPixels = 640.0 * 360.0, kMostTimes = 4.0;
  const double pictures = static_cast<double>(camera.width) * camera.height / kUsualPixels;
  return static_cast<std::size_t>(std::clamp(pictures, 1.0, kMostTimes) *
                                  static_cast<double>(views > 1 ? kMostOfSeveral : kMostTexels));
}

}  // namespace calipso::render

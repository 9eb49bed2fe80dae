#pragma once

#include <vector>

#include "calipso_render/light_fit.hpp"

namespace calipso::render {

// A pixel near the mirror direction of the sun.
struct HighlightSample {
  LightSample at;
  float spread = 0.0f;     // root mean square turn of the normal across the pixel, rad per axis
  std::size_t object = 0;  // of the views' actors
};

// Every pixel of the views inside the masks whose normal lies near the half vector of light and
// viewer, each in the cluster of the nearest of `samples` in its picture.
std::vector<HighlightSample> highlightSamples(const std::vector<View>& views,
                                              const std::vector<bool>& moves,
                                              const std::vector<LightSample>& samples,
                                              const Eigen::Vector3f& light);

}  // namespace calipso::render

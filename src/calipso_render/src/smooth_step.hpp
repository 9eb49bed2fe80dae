#pragma once

#include <algorithm>

namespace calipso::render {

// 0 up to `from`, 1 from `to` on, with a smooth rise between.
inline float smoothStep(float from, float to, float x) {
  const float t = std::clamp((x - from) / (to - from), 0.0f, 1.0f);
  return t * t * (3.0f - 2.0f * t);
}

}  // namespace calipso::render

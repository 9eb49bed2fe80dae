#pragma once

#include "calipso_render/visibility.hpp"

namespace calipso::render {

// Points gathered to look a light up at all of them at once.
class LightBatch {
 public:
  static constexpr int kMost = 72;

  // @return the point's number
  int add(const Eigen::Vector3f& position, const Eigen::Vector3f& normal) {
    for (int c = 0; c < 3; ++c) position_[c][count_] = position[c], normal_[c][count_] = normal[c];
    return count_++;
  }
  int count() const { return count_; }
  void clear() { count_ = 0; }

  // Visible part of the light at each point. @param visible kMost places
  void look(const Visibility& light, float* visible) const {
    if (count_ > 0)
      light.visibilities(
          {{position_[0], position_[1], position_[2]}, {normal_[0], normal_[1], normal_[2]}},
          count_, visible);
  }

 private:
  static constexpr int kRoom = kMost + 8;
  alignas(32) float position_[3][kRoom];
  alignas(32) float normal_[3][kRoom];
  int count_ = 0;
};

// Takes from the visible part of a light what another thing hides of it.
inline void multiplyBy(const Visibility& light, const LightBatch& points, float* visible) {
  if (light.empty()) return;
  float more[LightBatch::kMost];
  points.look(light, more);
  for (int k = 0; k < points.count(); ++k) visible[k] *= more[k];
}

}  // namespace calipso::render

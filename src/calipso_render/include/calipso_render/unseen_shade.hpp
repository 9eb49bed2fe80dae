#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <optional>

#include "calipso_render/stage.hpp"

namespace calipso::render {

// What something that no frame shows (a window's frame, a tree behind the camera) leaves of the sun,
// everywhere: what it keeps off a place it keeps off all that comes between the two. A picture of it,
// taken along the sun, of where the light comes down. Beside what is known of it the nearest that is
// holds.
class UnseenShade : public Visibility {
 public:
  UnseenShade() = default;  // there is none
  // @param hidden CV_8UC1: part of the sun that it hides from a place, 255 all
  // @param known CV_8UC1, != 0: where that holds
  // @param receiver pixel -> place
  // @param to_sun unit, world
  UnseenShade(const cv::Mat& hidden, const cv::Mat& known,
              const std::function<std::optional<Receiver>(int u, int v)>& receiver,
              const Eigen::Vector3f& to_sun);

  float visibility(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const override;
  bool empty() const override { return sun_.empty(); }
  std::optional<float> uniform(const Eigen::Vector3f& p, const Eigen::Vector3f& n,
                               float radius) const override;

 private:
  Eigen::Vector2f cellOf(const Eigen::Vector3f& p) const {
    return cells_per_metre_ * (across_ * p) - first_;
  }

  Eigen::Matrix<float, 2, 3> across_;  // two axes across the sun, unit
  float cells_per_metre_ = 1.0f;
  Eigen::Vector2f first_;  // of the picture's cells
  cv::Mat sun_;            // CV_32FC1, visible part
};

}  // namespace calipso::render

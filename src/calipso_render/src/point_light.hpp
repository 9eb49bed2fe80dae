#pragma once

#include <opencv2/core.hpp>
#include <opencv2/core/hal/intrin.hpp>

#include "calipso_render/light.hpp"

namespace calipso::render {

// A light laid out for many points: diffuseShading() and specularShading() with the channels in one
// register.
class PointLight {
 public:
  explicit PointLight(const Light& light);

  struct Shading {
    cv::Vec4f diffuse, highlight;  // B, G, R, 0
  };
  // @param tint of what the object itself throws back
  Shading at(const Gloss& gloss, const cv::Vec3f& tint, const Eigen::Vector3f& n,
             const Eigen::Vector3f& view, float sun, float sky) const;

 private:
  cv::v_float32x4 ambientAt(const Eigen::Vector3f& n) const;

  Eigen::Vector3f direction_;
  cv::v_float32x4 sun_, least_, ambient_[9];
  int terms_ = 1;  // harmonics that are not 0: the first one, four or nine
};

}  // namespace calipso::render

#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/background.hpp"
#include "calipso_render/stage.hpp"
#include "ray_scene.hpp"

namespace calipso::render {

// What shadows on the support planes say about the sun: log-darkness of the planes' pixels against
// the part of the sun that the objects hide from them.
//   y = b (1 - V(l)) + e_g
//   y    -log of brightness
//   b    depth of the shadow, >= 0
//   V    visible part of a sun in direction l
//   e_g  brightness of the pixel's group (0 where the plate is known)
class ShadowClue {
 public:
  struct Sample {
    Eigen::Vector3f position, normal;  // world
    float darkness;                    // y
    int group;  // pixels of one material; all of them 0 where the plate is known
  };

  // @param plate what was seen of the place, from the same camera; empty: nothing is known, and the
  // plane's own pixels are compared with each other, grouped by colour
  ShadowClue(const View& view, const std::vector<SupportPlane>& planes, const Background& plate);

  // How badly a sun in direction l explains the pixels, at its best b: minus a log-likelihood, 0
  // without any shadow.
  double misfit(const RayScene& objects, const Eigen::Vector3f& l) const;

  // Directions in which darkened pixels would lie in an object's shadow.
  std::vector<Eigen::Vector3f> candidates() const;

 private:
  std::vector<double> squaredErrors(const std::vector<float>& hidden) const;

  Eigen::Vector3f centre_ = Eigen::Vector3f::Zero();  // of the objects
  std::vector<Sample> samples_;
  bool plate_known_ = false;
  int groups_ = 1;
  double unshaded_ = 0.0, variance_ = 1.0;
};

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/background.hpp"
#include "calipso_render/stage.hpp"
#include "ray_scene.hpp"

namespace calipso::render {

// What shadows on the support planes say about the sun where other frames show the place without
// them: log-darkness of the planes' pixels against the part of the sun that the objects hide.
//   y = b (1 - V(l))
//   y  -log of brightness over that without shadow
//   b  depth of the shadow, >= 0
//   V  visible part of a sun in direction l
class ShadowClue {
 public:
  struct Sample {
    Eigen::Vector3f position, normal;  // world
    float darkness;                    // y
  };

  // @param plate what was seen of the place, from the same camera; may be empty
  ShadowClue(const View& view, const std::vector<SupportPlane>& planes, const Background& plate);

  // false: too little of the planes was seen without shadows, misfit() is 0
  bool plateKnown() const { return plate_known_; }

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
  double unshaded_ = 0.0, variance_ = 1.0;
};

}  // namespace calipso::render

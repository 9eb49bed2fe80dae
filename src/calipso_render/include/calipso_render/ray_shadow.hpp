#pragma once

#include <memory>
#include <vector>

#include "calipso_render/visibility.hpp"

namespace calipso::render {

class RayScene;

// Exact visibility by tracing rays (Embree) to fixed points of the light's disc: for final frames.
class RayShadow : public Visibility {
 public:
  struct Params {
    double angular_radius = 0.02;  // of the light, rad, < pi / 2
    int rays = 24;                 // where the first few disagree
  };

  // Copies what it needs. @param direction unit vector towards the light, world
  // @throw std::runtime_error if Embree cannot build the scene
  RayShadow(const std::vector<Occluder>& occluders, const Eigen::Vector3d& direction,
            const Params& params);
  ~RayShadow() override;

  float visibility(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const override;
  bool empty() const override;
  std::optional<float> uniform(const Eigen::Vector3f& p, const Eigen::Vector3f& n,
                               float radius) const override;

 private:
  std::unique_ptr<const RayScene> scene_;
  std::vector<Eigen::Vector3f> rays_;  // unit, towards the disc
  Eigen::Vector3f axis_h_, axis_s_, axis_t_, low_,
      high_;             // light space and the occluders' box in it, m
  float spread_ = 0.0f;  // tangent of the angular radius
  float lift_ = 0.0f;    // m off the surface at which rays start
};

}  // namespace calipso::render

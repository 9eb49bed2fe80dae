#pragma once

#include <vector>

#include "calipso_render/light.hpp"
#include "calipso_render/visibility.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::render {

// Support planes as surfaces above mirror them: where shade lies on them they are darker.
class ShadedGround {
 public:
  ShadedGround() = default;  // no planes
  // All of them must outlive this.
  // @param suns what each leaves of the sun; sky: of the sky over the planes
  ShadedGround(const std::vector<SupportPlane>& planes, const Light& light,
               std::vector<const Visibility*> suns, const Visibility& sky);

  // Part of its light, as it is in the open, that the place has which is seen from p in unit
  // direction w; 1 where that is on no plane.
  float lit(const Eigen::Vector3f& p, const Eigen::Vector3f& w) const;

 private:
  struct Plane {
    Eigen::Vector3f normal;
    float offset;            // m
    Eigen::Array2f x_range;  // m
    float sun;               // part of its light in the open that is the sun's
  };

  std::vector<Plane> planes_;
  std::vector<const Visibility*> suns_;
  const Visibility* sky_ = nullptr;
};

}  // namespace calipso::render

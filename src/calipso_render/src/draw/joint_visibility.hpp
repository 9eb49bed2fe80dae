#pragma once

#include <memory>
#include <vector>

#include "calipso_render/visibility.hpp"

namespace calipso::render {

// What groups of occluders leave of a light: each group what it does.
class JointVisibility : public Visibility {
 public:
  // @pre at least one
  explicit JointVisibility(std::vector<std::unique_ptr<Visibility>> groups);

  float visibility(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const override;
  void visibilities(const LightPoints& points, int count, float* visible) const override;
  bool empty() const override;
  std::optional<float> uniform(const Eigen::Vector3f& p, const Eigen::Vector3f& n,
                               float radius) const override;

 private:
  std::vector<std::unique_ptr<Visibility>> groups_;
};

// Occluders that are near each other as seen from a light, for a map of each: one of things far
// apart, such as a ball that has been thrown and what stays, would be coarse.
// @param direction towards the light, unit, world
std::vector<std::vector<Occluder>> nearGroups(const std::vector<Occluder>& occluders,
                                              const Eigen::Vector3d& direction);

}  // namespace calipso::render

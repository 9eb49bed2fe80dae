#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "calipso_render/visibility.hpp"

namespace calipso::render {

// Half the angle of the disc of sky that objects hide softly near a contact, rad.
constexpr double kSkyRadius = 0.8;

// Part of the sky's light that a plane gets where `seen` of the sky is visible: some comes from
// what is around, also where none is.
inline float skyLight(float seen) { return 0.15f + 0.85f * seen; }

// How much of the sky over a plane its points see: directions are followed up through two maps of
// heights, the lowest and the highest that the occluders have over each place. (What is right above
// decides how much is hidden; one map of the highest takes it for far away.) A place's column is
// closed between the two, so that an arch with something below it hides too much.
class SkyMap : public Visibility {
 public:
  struct Params {
    int resolution = 128;                // texels along the longer side, >= 16
    double angular_radius = kSkyRadius;  // of the disc of sky, rad, < pi / 2
    double farthest = 1e9;               // m over a point, from where on nothing hides any of it
  };

  // @param up unit normal of the plane, world
  SkyMap(const std::vector<Occluder>& occluders, const Eigen::Vector3d& up, const Params& params);

  // The normal does not matter: it is the plane's.
  float visibility(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const override;
  bool empty() const override { return columns_.empty(); }
  std::optional<float> uniform(const Eigen::Vector3f& p, const Eigen::Vector3f& n,
                               float radius) const override;

 private:
  static constexpr int kDirections = 24;

  Eigen::Vector3f placeOf(const Eigen::Vector3f& p) const;
  float besideBox(const Eigen::Vector3f& place) const;
  bool isClear(const Eigen::Vector3f& place, float radius) const;
  void keepHeights(const std::vector<Occluder>& occluders);

  Eigen::Vector3f axis_s_, axis_t_, axis_h_, origin_;
  float texel_ = 0.0f;                  // m
  float height_ = 0.0f;                 // of the occluders, texels
  float spread_;                        // tangent of the angular radius
  float farthest_ = 0.0f;               // texels
  int width_ = 0, depth_ = 0;           // texels
  std::vector<std::uint32_t> columns_;  // lowest (low half) and highest height over each place
  alignas(32) float x_[kDirections], y_[kDirections];  // of the directions, per height
};

}  // namespace calipso::render

#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "calipso_render/visibility.hpp"

namespace calipso::render {

struct ShadowTaps;
struct ShadowTexels;

// How much of a distant disc of light each point sees, from one depth map towards the disc's centre
// (percentage-closer soft shadows, Fernando 2005: the blockers' mean height sets the penumbra).
class ShadowMap : public Visibility {
 public:
  struct Params {
    int resolution = 768;          // texels along the longer side
    double angular_radius = 0.02;  // of the light, rad
    int taps = 16;                 // samples of the filter: 8, 16, 24 or 32
  };

  // @param direction unit vector towards the light, world
  ShadowMap(const std::vector<Occluder>& occluders, const Eigen::Vector3d& direction,
            const Params& params);

  float visibility(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const override;
  void visibilities(const LightPoints& points, int count, float* visible) const override;
  bool empty() const override { return !map_; }
  std::optional<float> uniform(const Eigen::Vector3f& p, const Eigen::Vector3f& n,
                               float radius) const override;

  // Length of a texel, m.
  float texel() const { return texel_; }

 private:
  struct Extremes {
    float lowest = std::numeric_limits<float>::max(), highest = VisibilityBuffer::kFar;
  };
  // Lowest and highest of windows of cells, by their first cell.
  struct Level {
    std::unique_ptr<float[]> low, high;
  };

  // A surface point in the map, lifted off so that it does not shade itself.
  struct Place {
    float s, t, h;  // texels, texels, m
  };
  Place placeOf(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const;

  ShadowTexels texels() const;
  void buildLevels();
  Level unset() const;
  Level coarsened() const;
  Extremes around(float s, float t, float reach) const;
  Extremes coneAround(float s, float t, float lowest, float margin) const;

  Eigen::Vector3f origin_, axis_s_, axis_t_, axis_h_;
  float texel_ = 0.0f, per_texel_ = 0.0f, angular_radius_ = 0.0f, highest_ = 0.0f;
  int width_ = 0, height_ = 0;
  std::shared_ptr<const ShadowTaps> taps_;
  // of the heights towards the light, m; none: nothing casts a shadow
  std::optional<VisibilityBuffer> map_;
  int columns_ = 0, rows_ = 0;  // of cells
  std::vector<Level> levels_;   // tell at once where all is lit or all is shaded
};

}  // namespace calipso::render

#pragma once

#include <vector>

#include "draw/surface_run.hpp"
#include "draw/triangle_map.hpp"
#include "frame/drawn_surfaces.hpp"
#include "frame/row.hpp"
#include "frame/seen_place.hpp"
#include "frame/staged_frame.hpp"
#include "frame/surface_sun.hpp"

namespace calipso::render {

// Light and look of an object, laid out for the shading of many points.
SurfaceShade layOut(const Light& light, const Appearance& appearance, const Look& look,
                    const Gloss& gloss);

// Lights and shades the drawn surfaces: stretches of pixels that see one object by their triangles'
// maps, other places one by one.
class SurfaceShader {
 public:
  // All of them must outlive this.
  SurfaceShader(const StagedFrame& frame, const SeenPlace& place, const DrawnSurfaces& surfaces,
                const MovedShadow& moved, const RestingLight& resting);

  // Colours of pixels [first, last) of the region's row of picture row v, all of which see the
  // object in `slot` and nothing of what lies behind; their places stand in row.run.
  // @pre they lie within SurfaceRun::kMost px that start at a multiple of kLightStep
  // @return TriangleMap::traits that any of their triangles has: what is told of kThin ones is of
  // no use
  unsigned shadeStretch(int v, int first, int last, int slot, Row& row) const;
  // Whether a triangle is kThin, and the colour of one that pixel (u, v) sees.
  // @param run for its places
  bool isThin(std::uint32_t id) const;
  cv::Vec3f shadedThin(std::uint32_t id, int u, int v, SurfaceRun& run) const;
  // Radiance of places of one object, run.colour.
  // @param count at most SurfaceRun::kMost
  void shadePlaces(const SurfacePlace* places, int count, int slot, SurfaceRun& run) const;

  // Least deviation of the noise of an object's pixels, code values.
  float grainOf(int slot) const {
    return frame_.params.add_noise ? appearanceOf(slot).grain : 0.0f;
  }

  SurfaceShader(const SurfaceShader&) = delete;  // its parts refer to each other

 private:
  const Appearance& appearanceOf(int slot) const {
    return frame_.prepared.appearances[frame_.objects[slot].surface];
  }
  std::vector<SurfaceMaps> findMaps(const ShadedGround& ground) const;
  void reflectStretch(unsigned traits, int v, int first, int last, int slot, Row& row) const;
  void addTexture(int v, int first, int last, int slot, Row& row) const;
  void reflectPlaces(const SurfacePlace* places, int count, int slot,
                     const Eigen::Vector3f* weights, SurfaceRun& run) const;

  const StagedFrame& frame_;
  const PlaneView& planes_;
  const VisibilityBuffer& centre_;
  const cv::Rect region_;
  const std::vector<SurfaceMaps> maps_;  // per slot; empty where it is not drawn
  std::vector<SurfaceShade> shades_;     // per slot
  const SurfaceSun sun_;
};

}  // namespace calipso::render

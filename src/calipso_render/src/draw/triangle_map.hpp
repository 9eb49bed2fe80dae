#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "calipso_render/appearance.hpp"
#include "calipso_render/stage.hpp"
#include "draw/surface_run.hpp"
#include "light/shaded_ground.hpp"

namespace calipso::render {

// What the pixels of a drawn triangle show, linear in the picture, each times the nearness: the
// place in the key frame's picture, homogeneous; the normal with the sky that it mirrors; the
// ambient light. Counted from the triangle's first corner, where single precision is exact.
struct alignas(16) TriangleMap {
  enum Trait : std::uint8_t {
    kThin = 1,      // too thin for single precision, or never seen
    kTurned = 2,    // its far side is seen
    kPictured = 4,  // its reflectance comes from the picture,
    kTextured = 8   // ... the texture, or both
  };

  float key[3][4];      // at the corner, per column, per row; x, y, w, 1
  float normal[3][4];   // likewise; world, sky
  float ambient[3][4];  // likewise; B, G, R, 0
  float u, v;           // the corner, px
  std::uint8_t traits;

  bool is(Trait trait) const { return (traits & trait) != 0; }
};

// A point of a surface that is to be shaded: what is seen of a triangle at a place of the picture.
struct SurfacePlace {
  std::uint32_t id;
  float u, v;
};

// What can be seen of an actor at any place of the picture.
class SurfaceMaps {
 public:
  SurfaceMaps() = default;
  SurfaceMaps(const Actor& actor, const Appearance& appearance, const Light& light,
              const ShadedGround& ground, const Eigen::Vector3f& eye);

  const TriangleMap* triangles() const { return triangles_.get(); }
  const TriangleMap& of(int triangle) const { return triangles_[triangle]; }

  // All of a run but `sun` and `colour`, from surface points within their triangles.
  // @param weights barycentric weights of each, written
  void locate(const SurfacePlace* places, int count, SurfaceRun& run,
              Eigen::Vector3f* weights) const;

 private:
  struct alignas(16) Vertex {
    float sight[4];   // from the eye, m, 0
    float normal[4];  // world, 0
    float key[4];     // place in the key picture, homogeneous, 1
  };
  // What a side of a vertex gets of ambient light.
  struct alignas(16) Around {
    float light[4];  // B, G, R, 0
    float sky[4];    // 0, 0, 0, sky
  };

  void fillTriangle(std::size_t t, const Appearance& appearance, const Eigen::Vector3f& eye);
  const std::vector<Around>& aroundOf(int triangle) const {
    const bool behind = of(triangle).is(TriangleMap::kTurned) && !around_behind_.empty();
    return behind ? around_behind_ : around_;
  }

  const Actor* actor_ = nullptr;
  cv::Point corner_;                            // Appearance::region's
  std::vector<Vertex> vertices_;                // per normal of the surface
  std::vector<Around> around_, around_behind_;  // the latter as Actor::seen_behind
  std::unique_ptr<TriangleMap[]> triangles_;
};

}  // namespace calipso::render

#pragma once

#include <Eigen/Core>
#include <optional>

#include "calipso_render/rasterizer.hpp"

namespace calipso::render {

// A mesh in the world that can stop light.
struct Occluder {
  const Points* vertices;  // world, m
  const Triangles* triangles;
  int winding = 0;  // Surface::winding
};

// Points by coordinates, world, with unit normals, for loops that may read seven more.
struct LightPoints {
  const float* position[3];
  const float* normal[3];
};

// How much of a distant disc of light the points of the scene see.
class Visibility {
 public:
  virtual ~Visibility() = default;

  // Visible fraction of the light, 0..1, from world point p with unit normal n. Thread-safe.
  virtual float visibility(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const = 0;

  // visibility() of `count` points at once; up to seven more are written.
  virtual void visibilities(const LightPoints& points, int count, float* visible) const;

  // Nothing casts a shadow: visibility() is 1 everywhere.
  virtual bool empty() const = 0;

  // What visibility() is all over the disc of `radius` around p, where that is known to be 0 or 1.
  virtual std::optional<float> uniform(const Eigen::Vector3f& p, const Eigen::Vector3f& n,
                                       float radius) const = 0;
};

}  // namespace calipso::render

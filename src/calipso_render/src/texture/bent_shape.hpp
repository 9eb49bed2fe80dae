#pragma once

#include <optional>
#include <vector>

#include "calipso_render/surface_texture.hpp"
#include "texture/sightings.hpp"

namespace calipso::render {

// Where places of a shape are on another one that it was bent to: each triangle takes what is near it
// along.
class BentShape {
 public:
  // @param from, to of the same vertices
  // @param parts connectedParts()
  BentShape(const Points& from, const Points& to, const Triangles& triangles,
            const std::vector<int>& parts);

  // None where the surface, or the part that the place is of, is not near.
  std::optional<Place> operator()(const Place& place) const;

 private:
  struct Sample {
    Eigen::Vector3f point;
    int triangle;
  };

  Eigen::Vector3i cellOf(const Eigen::Vector3f& x) const;
  std::size_t indexOf(const Eigen::Vector3i& cell) const;
  int nearestTriangle(const Place& place) const;

  const Points &from_, &to_;
  const Triangles& triangles_;
  const std::vector<int>& parts_;
  Eigen::Vector3f corner_;
  Eigen::Vector3i cells_;
  float side_;                          // of a cell, m
  std::vector<Eigen::Matrix3f> along_;  // per triangle
  std::vector<Sample> samples_;         // by cell
  std::vector<std::size_t> ends_;       // of the cells' samples
};

}  // namespace calipso::render

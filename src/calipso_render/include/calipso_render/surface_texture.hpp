#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_render/stage.hpp"

namespace calipso::render {

// Values on a mesh without a parametrisation: a regular grid of texels on every triangle,
// interpolated linearly (mesh colours, Yuksel et al. 2010). Texels on shared corners and edges
// exist once per triangle.
class SurfaceTexture {
 public:
  // @param texel wanted distance of texels, m; @param most bound of the texels' number, which makes
  // them coarser
  SurfaceTexture(const Points& vertices, const Triangles& triangles, float texel, std::size_t most);
  SurfaceTexture() = default;

  std::size_t size() const { return texels.size(); }
  float spacing() const { return spacing_; }  // m, of texels, about
  int triangleCount() const { return static_cast<int>(first_.size()); }
  // Texels of a triangle: [firstOf(t), firstOf(t + 1)).
  std::size_t firstOf(int triangle) const {
    return triangle < triangleCount() ? first_[triangle] : texels.size();
  }
  // Barycentric weights of a triangle's texel, counted from firstOf().
  Eigen::Vector3f weightsOf(int triangle, std::size_t texel) const;

  cv::Vec4f at(int triangle, const Eigen::Vector3f& weights) const;

  std::vector<cv::Vec4f> texels;

 private:
  std::size_t index(int i, int j, int rows) const {
    return static_cast<std::size_t>(i) * (rows + 1) - i * (i - 1) / 2 + j;
  }

  std::vector<std::size_t> first_;  // per triangle
  std::vector<int> steps_;          // per triangle: texels along an edge, minus one
  float spacing_ = 0.0f;
};

// What vertices far from all that is known go over to: by 1 - 1/e within `reach`, m.
struct FarValues {
  std::vector<cv::Vec3f> value;  // per vertex
  float reach;
};

// Fills vertices that have no value smoothly from those that have (harmonic on the mesh, or screened
// Poisson with values far away; vertices at one place are one).
// @param known per vertex; at least one must be
void diffuseOverMesh(const Points& vertices, const Triangles& triangles,
                     const std::vector<bool>& known, std::vector<cv::Vec3f>& values,
                     const std::optional<FarValues>& far = {});

}  // namespace calipso::render

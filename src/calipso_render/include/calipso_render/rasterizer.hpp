#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "calipso_scene/camera.hpp"

namespace calipso::render {

using Points = std::vector<Eigen::Vector3f>;
using Triangles = std::vector<Eigen::Vector3i>;

// A mesh on a picture plane: x, y in pixels, z = nearness. Nearness is any quantity that is linear
// in the picture and grows towards the viewer: 1 / depth (1/m) for a pinhole camera, height towards
// the light (m) for a parallel projection. A vertex that cannot be projected has nearness NaN.
struct ScreenMesh {
  Points points;
  const Triangles* triangles = nullptr;
  // Sign of the area in the picture (rows downwards: positive is clockwise) of triangles that
  // others are known to hide: those on the far side of a mesh that encloses space. They are left
  // out. 0: all can be seen.
  int hidden_side = 0;

  bool hides(float area) const { return static_cast<float>(hidden_side) * area > 0.0f; }
};

// @param world #V points in the world, m
ScreenMesh projectMesh(const Points& world, const Triangles& triangles, const Camera& camera);

// To each of them; they have to stay where they are.
std::vector<const ScreenMesh*> pointersTo(const std::vector<ScreenMesh>& meshes);

// Bounding rectangle in whole pixels, grown by `margin` px and clipped to `size`.
cv::Rect boundsOf(const ScreenMesh& mesh, int margin, cv::Size size);

// Which surface each pixel sees: one sample at the pixel's centre, nearest surface wins, at a tie
// the first.
class VisibilityBuffer {
 public:
  static constexpr std::uint32_t kNothing = 0xffffffffu;

  // @param region of the picture that is kept; everything outside is clipped
  // @param meshes at most 255; objectOf() tells the number of one among them
  // @param with_ids false: only nearness is kept
  VisibilityBuffer(const cv::Rect& region, const std::vector<const ScreenMesh*>& meshes,
                   bool with_ids = true);

  const cv::Rect& region() const { return region_; }
  // Region coordinates.
  const std::uint32_t* ids(int row) const { return &ids_[static_cast<std::size_t>(row) * stride_]; }
  const float* nearness(int row) const { return &near_[static_cast<std::size_t>(row) * stride_]; }
  int stride() const { return stride_; }  // places from row to row
  // Picture coordinates; outside the region nothing is seen.
  std::uint32_t idAt(int u, int v) const {
    u -= region_.x, v -= region_.y;
    const bool inside = u >= 0 && v >= 0 && u < region_.width && v < region_.height;
    return inside ? ids(v)[u] : kNothing;
  }
  float nearnessAt(int u, int v) const {
    u -= region_.x, v -= region_.y;
    const bool inside = u >= 0 && v >= 0 && u < region_.width && v < region_.height;
    return inside ? nearness(v)[u] : kFar;
  }

  static int objectOf(std::uint32_t id) { return static_cast<int>(id >> 24); }
  static int triangleOf(std::uint32_t id) { return static_cast<int>(id & 0xffffffu); }
  static constexpr float kFar = -3.0e38f;

 private:
  // places after each row, which kernels may read and write back
  static constexpr int kPadding = 8;

  cv::Rect region_;
  int stride_;
  std::unique_ptr<std::uint32_t[]> ids_;  // null: only nearness is kept
  std::unique_ptr<float[]> near_;
};

// Perspective-correct barycentric weights of pixel (u, v) in a triangle of `mesh` whose nearness is
// 1 / depth; clamped into the triangle.
Eigen::Vector3f barycentric(const ScreenMesh& mesh, int triangle, float u, float v);

}  // namespace calipso::render

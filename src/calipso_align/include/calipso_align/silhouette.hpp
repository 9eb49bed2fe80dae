#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <vector>

#include "calipso_align/mesh_topology.hpp"
#include "calipso_scene/camera.hpp"
#include "calipso_scene/triangle_mesh.hpp"

namespace calipso::align {

// All points moved by a rigid motion.
inline Points transformed(const Eigen::Isometry3d& motion, const Points& points) {
  return (points * motion.linear().transpose()).rowwise() + motion.translation().transpose();
}

// A depth image of the part of the picture that a mesh covers.
struct DepthRendering {
  cv::Rect roi;     // part of the picture, px; empty when nothing is visible
  cv::Mat1f depth;  // roi.size(), m along the optical axis; 0: the mesh is not seen there

  // Depth at pixel (u, v) of the picture, 0 outside.
  float at(int u, int v) const { return roi.contains({u, v}) ? depth(v - roi.y, u - roi.x) : 0.0f; }
};

// Renders with a depth buffer. `x` holds the vertices in the camera frame. Triangles that reach
// behind the camera are left out.
DepthRendering renderDepth(const Points& x, const Triangles& triangles, const Camera& camera);
// The same without drawing what closed shells hide themselves: their back faces.
DepthRendering renderDepth(const Points& x, const MeshTopology& topology, const Camera& camera);

// 255 where the rendering covers the pixel; the whole picture.
cv::Mat1b maskOf(const DepthRendering& rendering, const Camera& camera);

// Bounding box of what is rendered, px; empty when that is nothing.
cv::Rect boundsOf(const DepthRendering& rendering);

// A point of the visible outline: on the edge v0-v1, where it projects to, and which way is out.
struct OutlinePoint {
  int v0, v1;
  double a0, a1;             // barycentric weights on the edge
  Eigen::Vector3d position;  // camera frame, m
  Eigen::Vector2d pixel;     // px
  Eigen::Vector2d normal;    // unit, from the object outwards
  double length_px;          // how much of the outline it stands for
};

// The occluding contour that borders the rendered mask, holes included: samples every `step_px` of
// the edges between a front and a back face (or at a rim) beyond which the mask ends within a
// pixel. Parts outside the picture are left out: they bear no boundary.
std::vector<OutlinePoint> occludingContour(const Points& x, const MeshTopology& topology,
                                           const DepthRendering& rendering, const Camera& camera,
                                           double step_px);

}  // namespace calipso::align

#pragma once

#include <opencv2/core.hpp>

#include "calipso_flow/object_model.hpp"
#include "calipso_scene/camera.hpp"

namespace calipso::flow {

// What a camera sees of a surface: depth along the optical axis inside a window of the picture.
struct SurfaceView {
  cv::Rect window;  // px, inside the picture; empty when the surface is not seen
  cv::Mat depth;    // CV_32F, window-sized, m; 0 = not covered

  bool empty() const { return window.area() == 0; }
  // Depth at the pixel nearest to (u, v) of the picture; 0 outside.
  float depthAt(double u, double v) const;
};

// For every pixel that sees a moved surface: where the same surface point stands before the move.
struct CarriedView {
  cv::Rect window;   // px, inside the picture
  cv::Mat position;  // CV_32FC3, window-sized: the carried coordinates; (0, 0, 0) = not covered
};

// Draws the triangles of `mesh`, moved to `moved` (camera frame, #V x 3), and interpolates
// `carried` (#V x 3, not zero where it counts) over them.
CarriedView carrySurface(const TriangleMesh& mesh, const Camera& camera,
                         const decltype(TriangleMesh::vertices)& moved,
                         const decltype(TriangleMesh::vertices)& carried);

// Draws `mesh` into a z-buffer. Triangles that reach behind the camera are left out.
// @param camera_from_object  pose of the mesh in the camera frame
SurfaceView viewSurface(const TriangleMesh& mesh, const Camera& camera,
                        const Eigen::Isometry3d& camera_from_object);

}  // namespace calipso::flow

#pragma once

#include <array>
#include <vector>

#include "calipso_align/observation.hpp"
#include "calipso_align/silhouette.hpp"

namespace calipso::align {

// Observed depth inside of an object's silhouette, away from its edge where two surfaces mix.
struct DepthTarget {
  cv::Mat1f depth;       // m, the whole picture; 0: unknown or not the object
  double quantum = 0.0;  // m; smallest deviation that is believed

  bool empty() const { return depth.empty(); }
};

// @param depth       m along the optical axis; 0, NaN or negative: unknown
// @param silhouette  255 inside the object
DepthTarget makeDepthTarget(const cv::Mat1f& depth, const cv::Mat1b& silhouette);

// Where on a face a point of a mesh's surface lies.
struct SurfacePoint {
  int face;
  std::array<double, 3> weights;  // barycentric
};

// Some thousand points, spread evenly over the surface however coarse its mesh is.
std::vector<SurfacePoint> spreadOver(const Points& x, const Triangles& triangles);

struct DepthTermOptions {
  double robust = 0.0;     // m; residuals beyond are occluders, holes or other surfaces
  double sigma = 0.0;      // m; least deviation of one sample
  double samples = 200.0;  // how many independent measurements the picture is worth
};

// Those of the points that are seen against the observed surface, along their faces' normals (point
// to plane), m. The deviation is estimated from the residuals themselves, so that noisy depth counts
// for less.
Rows depthRows(const DepthTarget& target, const Points& x, const Triangles& triangles,
               const std::vector<SurfacePoint>& points, const DepthRendering& rendering,
               const Camera& camera, const DepthTermOptions& options);

// Median of observed minus rendered depth where both are known; 0 where they share no pixel.
double medianDepthOffset(const DepthTarget& target, const DepthRendering& rendering);

}  // namespace calipso::align

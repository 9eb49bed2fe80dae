#pragma once

#include <vector>

#include "calipso_align/contour.hpp"
#include "calipso_align/silhouette.hpp"

// How far a fit is from the truth. For evaluators and tests; a fit itself knows no truth.
namespace calipso::align {

struct ContourError {
  double mean_px = 0.0, p95_px = 0.0;
};

// Distances between the known contour and the model's outline, both ways.
ContourError contourError(const std::vector<ContourLoop>& contour, const Points& x,
                          const MeshTopology& topology, const Camera& camera);

// The same between the outer hulls: loops that are no holes, and the outline towards the picture's
// border.
ContourError hullError(const std::vector<ContourLoop>& contour, const Points& x,
                       const MeshTopology& topology, const Camera& camera);

struct SurfaceError {
  double mean = 0.0, rms = 0.0, hausdorff = 0.0;  // m
};

// Distances between two surfaces, both ways: of each one's vertices to the nearest point of the
// other.
SurfaceError surfaceError(const Points& a, const Points& b, const Triangles& triangles_a,
                          const Triangles& triangles_b);

// Mean distance in the picture between the projections of equal vertices, px.
double reprojectionError(const Points& x, const Points& truth, const Camera& camera,
                         const std::vector<int>& vertices);

// Scale about the camera's centre that brings x to the truth's depth: what no picture can show.
double depthGauge(const Points& x, const Points& truth);

// Intersection over union of two masks; 1 when both are empty.
double intersectionOverUnion(const cv::Mat1b& a, const cv::Mat1b& b);

}  // namespace calipso::align

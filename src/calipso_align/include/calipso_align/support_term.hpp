#pragma once

#include <optional>
#include <vector>

#include "calipso_align/observation.hpp"
#include "calipso_align/silhouette.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::align {

// A support plane as the fit sees it: n.x = d in the camera frame, and whether the object stands on
// it.
struct SupportTarget {
  SupportPlane plane;      // world
  Eigen::Vector3d normal;  // camera frame
  double offset = 0.0;     // camera frame, m
  bool stands = false;
};

std::vector<SupportTarget> makeSupportTargets(const std::vector<SupportPlane>& planes,
                                              const Camera& camera);

// Height of the lowest vertex above the plane, m; nothing when the plane ends beside the object.
std::optional<double> clearance(const SupportTarget& target, const Points& x, const Camera& camera);

// How far below a plane, m, something reaches through it rather than being off.
// @param sigma  what a vertex may be off, m
double reachesThrough(double sigma);

// Vertices under a plane are pushed out of it; the lowest one of an object that stands is held on
// it. Residuals in m.
// @param sigma  what a vertex may be off, m
Rows supportRows(const std::vector<SupportTarget>& targets, const Points& x, const Camera& camera,
                 double sigma);

}  // namespace calipso::align

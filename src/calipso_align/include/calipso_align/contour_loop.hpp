#pragma once

#include <Eigen/Core>
#include <vector>

namespace calipso::align {

// One closed loop of an object's silhouette. Pixels, pixel centres at integer coordinates.
struct ContourLoop {
  std::vector<Eigen::Vector2d> points;  // ordered along the loop, px; the last joins the first
  std::vector<float> confidence;        // per point, 0..1
  std::vector<bool> known;              // per point: false where something else hides the edge
  bool hole = false;                    // an inner loop: the object lies outside of it
};

}  // namespace calipso::align

#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_align/contour.hpp"
#include "calipso_align/mesh_topology.hpp"
#include "calipso_scene/camera.hpp"

namespace calipso::align {

// Where an object's model is in a picture.
struct ModelSurface {
  Points points;  // camera frame, m
  Triangles triangles;
  Camera camera;
};

// How an object's model looks where it was fitted to a contour. Of the whole picture.
struct ModelView {
  cv::Mat1b silhouette;       // 255 inside
  cv::Mat1f depth;            // m along the optical axis, 0 outside
  double tolerance_px = 2.0;  // how far its outline may be off
  ModelSurface surface = {};  // of what may move as a whole; else empty
};

// Fits the model to a contour; nothing where it cannot be fitted.
using ModelFitter = std::function<std::optional<ModelView>(const std::vector<ContourLoop>&)>;

}  // namespace calipso::align

#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_align/contour.hpp"

namespace calipso::align {

// How an object's model looks where it was fitted to a contour. Of the whole picture.
struct ModelView {
  cv::Mat1b silhouette;       // 255 inside
  cv::Mat1f depth;            // m along the optical axis, 0 outside
  double tolerance_px = 2.0;  // how far its outline may be off
};

// Fits the model to a contour; nothing where it cannot be fitted.
using ModelFitter = std::function<std::optional<ModelView>(const std::vector<ContourLoop>&)>;

}  // namespace calipso::align

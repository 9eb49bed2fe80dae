#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_flow/object_model.hpp"
#include "calipso_scene/scene.hpp"
#include "perturbation.hpp"

namespace calipso::flow {

// A model as calipso_align fits it to the scene's key frame, from strokes, rough placement and,
// where there is one, the depth image; and where the object was found.
struct AlignedModel {
  ObjectModel model;
  cv::Mat mask;  // CV_8U
};

// In the scene's order of objects. @throw what calipso_align throws
std::vector<AlignedModel> alignedModels(const Scene& scene, const Perturbation& perturbation);

}  // namespace calipso::flow

#pragma once

#include <optional>
#include <vector>

#include "calipso_align/alignment.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::align {

// The scene's depth image of the key frame, or nothing when it has none.
// @throw std::runtime_error naming file, what is wrong and the remedy
std::optional<DepthObservation> loadDepth(const Scene& scene);

// By how much a smaller image was enlarged by repeating its pixels, when every step lies on the
// lattice of a coarser image; 1 for any other. NaN differs from its neighbours.
double enlargement(const cv::Mat1f& depth);

// How deep the support planes lie under every pixel, m, one image per plane; 0 where it is not met.
std::vector<cv::Mat> supportDepths(const std::vector<SupportPlane>& planes, const Camera& camera);

}  // namespace calipso::align

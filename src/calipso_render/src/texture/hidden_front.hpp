#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "texture/texture_fill.hpp"

namespace calipso::render {

// The part of an object's front that other objects hide in the key frame, as if it were seen: filled
// from what is seen of the front around it, straight lines going on, and trusted where it was filled
// alone. Nothing if they hide too little, or too little is seen beside it.
// @param labels of the key frame @param pieces smoothParts() of the surface
std::optional<Reflectance> hiddenFront(const cv::Mat& labels, const Surface& surface,
                                       const std::vector<int>& pieces, const Reflectance& seen);

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// A highlight on what is not quite smooth (peel, hammered metal) goes on beyond its lobe, in bright
// spots. What lies within as far again around the lobe's middle, or the part that hides the
// reflectance, and is brighter than what is around by a greyish light, is hidden, too; what has
// another colour more, or one that is seen beside it as well (a pattern's), is not.
// @param albedo CV_32FC3. @param trust CV_32FC1
// @param lobe CV_32FC1: part of the light that is the sun's highlight
// @param clear in, out: of Reflectance
void hideRemains(const cv::Mat& albedo, const cv::Mat& trust, const cv::Mat& lobe, cv::Mat& clear);

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// Of one object in a picture, pixel by pixel.
struct SurfaceLight {
  cv::Mat now, open;  // CV_32FC3: shading of a white surface; if nothing were before it
  cv::Mat certain;    // CV_8UC1: 255 where the picture tells the reflectance
};

// Takes out shade that the model predicts and the picture does not have: where parts of the model
// are fitted into each other, or a shadow falls beside its place, a picture divided by next to no
// light seems to be brighter than white. What lies in shade that something else casts, and is
// brighter than all around it of which the light is certain, is taken to lie in the open.
// @param floor added to the light before the picture was divided by it
// @param albedo CV_32FC3
void takeOutFalseShade(const SurfaceLight& seen, const cv::Vec3f& floor, cv::Mat& albedo);

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// What a picture shows of one object's surface, pixel by pixel.
struct SurfacePicture {
  cv::Mat position, normal;  // CV_32FC3: world, m; normal 0 where the object is not seen
  cv::Mat light, open;       // CV_32FC3: shading of a white surface; if nothing were before it
  cv::Mat trust;             // CV_32FC1: Reflectance::trust
};

// Takes out shade that the model predicts and the picture does not have: where parts of the model
// are fitted into each other, or a shadow falls beside its place, a picture divided by next to no
// light seems to be brighter than white. What lies in shade that something else casts, and is
// brighter than all around it of which the light is certain, is taken to lie in the open.
// @param floor added to the light before the picture was divided by it
// @param pixel side of a pixel at the object's distance, m; @param albedo CV_32FC3
void takeOutFalseShade(const SurfacePicture& seen, const cv::Vec3f& floor, float pixel,
                       cv::Mat& albedo);

}  // namespace calipso::render

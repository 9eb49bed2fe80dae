#pragma once

#include <vector>

#include "calipso_render/appearance.hpp"

namespace calipso::render {

// The reflectance that one picture shows of an object.
struct Reflectance {
  cv::Rect region;
  cv::Mat codes;     // CV_32FC3: the picture there, code values
  cv::Mat albedo;    // CV_32FC4, extended beyond the silhouette; the fourth unused
  cv::Mat nearness;  // CV_32FC1: 1 / depth of the object's front, 0 = none
  cv::Mat normal;    // CV_32FC3: of the front, world, towards the camera
  cv::Mat triangle;  // CV_32SC1: of the front, -1 = none
  cv::Mat open;      // CV_32FC1: SkySeen::open of the front
  cv::Mat trust;     // CV_32FC1
  cv::Mat clear;     // CV_32FC1: 1 where no highlight hides the reflectance
  cv::Vec3f mean_light;
};

// What is known of an object: the key frame first.
struct SeenObject {
  const std::vector<const View*>& views;
  const std::vector<const Actor*>& actors;
  const std::vector<Reflectance>& pictures;
};

// Makes the appearance's texture: every place of the surface as the pictures show it, one over the
// other by how well they do; what another object hides in the key frame as hiddenFront() has it;
// what they leave open, as the key frame shows places that are like it by the mesh's shape (its
// mirror images and what is turned about an axis of revolution, in the order of keepBest); then the
// place's own, seen at a flat angle; then the front of the object at the same pixel, where the
// place is as if mirrored in the picture's plane. What is left continues the surface's pattern
// (continuePattern), or the surface around it smoothly.
// @param a  has region and albedo
void fillTexture(const SeenObject& object, Appearance& a);

}  // namespace calipso::render

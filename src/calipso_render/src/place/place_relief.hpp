#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/inpaint.hpp"
#include "calipso_render/relief.hpp"

namespace calipso::render {

// A plane of the place in a camera's picture: the nearness of its pixels is affine, 1 / z = a u + b
// v + c.
struct PicturePlane {
  Eigen::Vector3d abc;

  double nearnessAt(int u, int v) const { return abc[0] * u + abc[1] * v + abc[2]; }
  // World; towards the camera.
  Eigen::Vector3f normal(const Camera& camera) const;
  // The homography from pixels to coordinates (m) along it, the third one its nearness.
  cv::Matx33d fromPixels(const Camera& camera) const;
};

PicturePlane inPicture(const SupportPlane& plane, const Camera& camera);
// Of those that do not end.
std::vector<PicturePlane> inPicture(const std::vector<SupportPlane>& planes, const Camera& camera);

// The largest planes among the pixels of `wanted`.
std::vector<PicturePlane> picturePlanes(const cv::Mat& nearness, const cv::Mat& wanted);

// Which surface of the place every pixel sees, or would see without the objects.
struct PlaceSurfaces {
  static constexpr int kUnknown = 0, kCurved = InpaintParams::kNoPlane;

  // CV_8UC1: kUnknown; the support planes from 1 on, then other planes; kCurved: what is none of
  // them
  cv::Mat label;
  // CV_8UC1: surface whose like what is hidden is filled from: the label, but kCurved (no plane)
  // where none of the planes goes on, kUnknown just below the horizon
  cv::Mat alike;
  cv::Mat
      sure;  // CV_8UC1: 255 where a plane is seen, or hidden and nothing else is seen nearer by that does not meet it
  cv::Mat sky;                       // InpaintParams::sky, of what is seen
  cv::Mat position, normal;          // CV_32FC3, world, off the support planes
  int supports = 0;                  // support planes
  std::vector<PicturePlane> planes;  // of label k + 1

  bool empty() const { return label.empty(); }
  // `sure` of all but the support planes.
  cv::Mat sureOffSupports() const;
};

// By the depth image. Behind objects a plane goes on as long as it is seen nearer by than what
// shows that it has ended; of the planes that do and lie behind the object the nearest is seen.
// Empty without a depth image.
// @param scenery CV_32FC1, 1/m, of what is no object; 0 unknown
// @param depth CV_32FC1, m, with the objects; 0 unknown
// @param labels CV_8UC1, != 0 on objects
PlaceSurfaces findSurfaces(const cv::Mat& scenery, const cv::Mat& depth, const cv::Mat& labels,
                           const std::vector<SupportPlane>& planes, const Camera& camera);

// Makes what is invented as near as the plane that goes on there, if one does.
// @param invented CV_8UC1, != 0: hidden, and shown by no frame @param nearness CV_32FC1, 1/m
void followPlanes(const PlaceSurfaces& surfaces, const cv::Mat& invented, cv::Mat& nearness);

// What of them lies off the support planes. @param sun unit, towards it: of what faces away from it
// only planes take shade, that of the sky
Relief findRelief(const PlaceSurfaces& surfaces, const Eigen::Vector3f& sun);

// The outermost pixels of what stands out, which the scenery leaves to what is behind it, are the
// relief's, where the depth image shows them to be nearer to that than to what is behind.
// @param scenery CV_32FC1, 1/m, 0 unknown @param depth CV_32FC1, m, 0 unknown
void addRims(const cv::Mat& scenery, const cv::Mat& depth, Relief& relief);

// CV_8UC1: 255 where it faces away from the sun.
cv::Mat turnedAway(const Relief& relief, const Eigen::Vector3f& sun);

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/renderer.hpp"

namespace calipso::render {

// Edited objects drawn where the video has them, which stays the same while the same ones are
// edited. Pictures are of the whole key frame.
struct RestPicture {
  RestPicture() = default;
  RestPicture(const std::vector<bool>& edited, const cv::Size& size);

  // Gives every pixel of a region the owner of the nearest one that has any, and finds how far what
  // drawing misses can reach.
  // @param seen CV_16SC1 over the region: surface that is seen, -1 = none
  // @param removed CV_8UC1 over it: pixels of the objects in the video
  void spreadOwners(const cv::Mat& seen, const cv::Mat& removed, const cv::Rect& region);

  std::vector<bool> edited;  // per surface; empty: of nothing yet
  cv::Mat drawn;             // CV_32FC3: what they add to a pixel, linear, also mirrored
  // CV_32FC3: part of the background's light that passes beside them; negative where the video does
  // not show them
  cv::Mat passing;
  cv::Mat owners;  // CV_16SC1: surface that is seen there, or nearest; -1 = none
  cv::Mat reach;   // CV_8UC1: 255 where what drawing misses can be carried to
  cv::Rect box;    // of what they show
};

// The plate as a frame in which these objects are edited but stay where the key frame has them.
FrameInput frameAtRest(const Prepared& prepared, const std::vector<bool>& edited);

}  // namespace calipso::render

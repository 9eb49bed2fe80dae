#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "frame/edited_region.hpp"
#include "frame/seen_place.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

constexpr int kMixed = 2;  // px around an object in which its hue mixes into others'

// What the video shows of edited objects in a box, with a margin, and of others: kept from frame to
// frame as long as it shows the same.
class ShownPixels {
 public:
  void update(const StagedFrame& frame, const SeenPlace& place, const cv::Rect& box);

  // CV_8UC1 of the box's size
  const cv::Mat& own() const { return own_; }
  const cv::Mat& others() const { return others_; }

 private:
  cv::Mat own_, others_;
  // What they hang on
  cv::Mat labels_;  // of the box
  cv::Rect box_;
  std::vector<bool> edited_;
  bool at_key_camera_ = false;
};

// What the video shows of edited objects and their shadows: pixels behind which the place comes to
// light. What objects show has a margin; of what stands beside them only where their hue mixes.
// @param passing CV_8UC1, whole picture: passingShadows(); may be empty
// @param mirrored Reflections::marks(): where that changes and hid all of a plane, it comes to light
// @return CV_8UC1 over the region
cv::Mat removedPixels(const StagedFrame& frame, const SeenPlace& place, const EditedRegion& region,
                      const cv::Mat& passing, const cv::Mat& mirrored, ShownPixels& shown);

// The pixels of `box` that show an object in the video. CV_8UC1
cv::Mat shownOf(const StagedFrame& frame, const SeenPlace& place, int surface, const cv::Rect& box);

// What a box's pixels show, with a margin, of objects that pass in the video, edited or not.
cv::Mat shownInPassing(const StagedFrame& frame, const cv::Rect& box, int margin);

// What a box's pixels show of edited objects that are not where the video has them, with the margin
// in which their hue mixes into others', but for pixels that such an object owns itself.
// @param owners CV_16SC1 over the box: surfaces; -1 = none
cv::Mat shownOfMoved(const StagedFrame& frame, const cv::Mat& owners, const cv::Rect& box);

}  // namespace calipso::render

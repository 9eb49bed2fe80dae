#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "frame/moved_shadow.hpp"
#include "frame/place_light.hpp"
#include "frame/resting_light.hpp"
#include "frame/row.hpp"
#include "frame/seen_place.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

// px around a surface of a new look in which the frame has its old colour, too
constexpr int kRepaintReach = 2;

// Pixels of edited objects at which nothing has moved, nor their light: the frame's own are the
// best picture of them.
class StillPixels {
 public:
  static constexpr float kKept = 0.999f;  // of a pixel at rest: it keeps its bytes

  // All of them must outlive this.
  // @param centre what the pixels of the region see
  // @param removed CV_8UC1 over it: pixels of edited objects in the video
  StillPixels(const StagedFrame& frame, const SeenPlace& place, const VisibilityBuffer& centre,
              const cv::Mat& removed);

  // Leaves out what others that have moved, or another sun, light otherwise than the video: the
  // surfaces, and what of their rims lies on the place. That keeps its pixels in their new light,
  // and is not removed; but where edited objects move in the video these have their shadows.
  void leaveRelit(const PlaceLight& light, const MovedShadow& moved, const RestingLight& resting,
                  cv::Mat& removed);

  // Everything moved, or nothing is to be kept.
  bool none() const { return parts_.empty(); }
  // Row of the region: 1 = nothing moved at the pixel. @pre !none()
  const float* row(int j) const { return parts_.ptr<float>(j); }
  // Does the rim of a surface at rest lie at (i, j) of the region, in another light than before?
  bool isRelit(int i, int j) const { return !relit_.empty() && relit_.at<std::uint8_t>(j, i) != 0; }
  // Gives the pixels of picture row v their part of the frame's own.
  void keep(int v, Row& row) const;

 private:
  // What of edited objects the pixels of the region see.
  struct Seen {
    cv::Mat owner;      // CV_16SC1: surface, -1 = none
    cv::Mat repainted;  // CV_8UC1: in a new look
  };
  bool findResting(const StagedObject& object, std::vector<char>& can_rest) const;
  Seen findParts(const std::vector<std::vector<char>>& can_rest);
  void keepRims(const cv::Mat& owner);
  void keepLines(int surface, const cv::Mat& owner, cv::Mat& rims) const;
  void addRim(int surface, const cv::Mat& owner, cv::Mat& rims) const;
  cv::Mat shownOfOthers(int surface, const cv::Rect& box) const;
  cv::Mat nearerToLeft(int surface, const cv::Mat& rests, const cv::Mat& owner,
                       const cv::Rect& box) const;

  const StagedFrame& frame_;
  const SeenPlace& place_;
  const VisibilityBuffer& centre_;
  const cv::Mat removed_;
  const cv::Rect region_;
  cv::Mat parts_;  // CV_32FC1 over the region
  cv::Mat relit_;  // CV_8UC1 likewise; may be empty
};

}  // namespace calipso::render

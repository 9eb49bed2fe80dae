#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/inpaint.hpp"
#include "fill/patch_levels.hpp"
#include "fill/pattern.hpp"

namespace calipso::render {

constexpr int kPatchRadius = 3;  // px; patches are squares of 7
constexpr int kPatchSide = 2 * kPatchRadius + 1;

// Are both labels known, and not the same? @param labels CV_8UC1; 0 unknown
inline bool differ(std::uint8_t own, std::uint8_t other) {
  return own != 0 && other != 0 && own != other;
}
inline bool differ(const cv::Mat& labels, const cv::Point& p, const cv::Point& q) {
  return differ(labels.at<std::uint8_t>(p), labels.at<std::uint8_t>(q));
}

// What is known of the patch around a place, in floats of the image from its middle.
std::vector<int> knownAround(const cv::Point& p, const cv::Mat& known, const cv::Mat& image);

// What it costs to copy the patch around q to p: how unlike they look, in squared code values
// summed over the patch, and how little like the places are. Patches must lie within the picture.
class PatchCost {
 public:
  // @param scale   size of the level's pixels in those of the finest
  // @param horizon difference of nearness that does not count
  // @param pattern px of the finest level
  PatchCost(const FillLevel& level, float scale, float horizon, const Pattern& pattern,
            const InpaintParams& params);

  // No less than `bound` if it is not below. @param image CV_32FC4
  // @param lively CV_32FC1: mean of its last channel over the patch around every pixel
  float distance(const cv::Mat& image, const cv::Mat& lively, const cv::Point& p,
                 const cv::Point& q, float bound) const;
  // By a part of the patch. @param seen knownAround()
  float partialDistance(const cv::Mat& image, const cv::Point& p, const cv::Point& q,
                        const std::vector<int>& seen, float bound) const;

  // The place nearest to q from which p can be copied by a shift of the pattern; q without one.
  cv::Point onPattern(const cv::Point& p, const cv::Point& q) const {
    const auto whole = repeats_ ? pattern_.nearest(p.y, q - p) : std::nullopt;
    return whole ? p + cv::Point(cvRound(whole->x), cvRound(whole->y)) : q;
  }

  // Label of the surface at a place; 0 unknown.
  int surfaceAt(const cv::Point& p) const { return at(p).surface; }
  bool onOther(const cv::Point& p, const cv::Point& q) const {
    return differ(at(p).surface, at(q).surface);
  }
  // Unlike planes, what is none may be many things, some of which look like others.
  bool onOtherPlane(const cv::Point& p, const cv::Point& q) const {
    return onOther(p, q) && surfaceAt(p) != InpaintParams::kNoPlane &&
           surfaceAt(q) != InpaintParams::kNoPlane;
  }

 private:
  // What is known of a place; 0 nothing.
  struct Known {
    float nearness;
    std::uint8_t surface, sky;
    std::uint8_t mixed;  // != 0: the patch around it sees several surfaces
  };

  const Known& at(const cv::Point& p) const { return places_[p.y * columns_ + p.x]; }
  inline float awayCost(const cv::Point& p, const cv::Point& q) const;
  inline float blandCost(const cv::Mat& lively, const cv::Point& p, const cv::Point& q) const;
  inline bool isOffPattern(const cv::Point& p, const cv::Point& q) const;
  float offColour(const cv::Point& p, const cv::Point& q) const;

  int columns_;
  std::vector<Known> places_;
  // CV_32FC4, before the hole is filled: means over a patch, and, near the hole, far around it; empty
  // if no colour counts
  cv::Mat colours_, expected_;
  float scale_, horizon_;
  Pattern pattern_;  // of this level
  bool repeats_;     // the pattern knows any shifts
  // as InpaintParams'
  float away_row_, away_column_, away_farther_, off_colour_, off_bland_;
};

}  // namespace calipso::render

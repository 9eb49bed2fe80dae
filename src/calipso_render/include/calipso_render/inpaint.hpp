#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

struct InpaintParams {
  int coarsest_side = 30;    // px; the pyramid ends where the picture's shorter side has no more
  int coarsest_rounds = 12;  // of search and vote at the coarsest level, at most,
  int rounds = 4;            // at the finer ones
  float away_row = 6.0f,
        away_column =
            0.2f;  // what a px of way to the source counts, squared code values: places are layered
  // squared code values per unit by which a place is nearer than the source, over that: what is
  // farther has less detail
  float away_farther = 0.0f;
  // what a squared code value counts by which a source's mean colour is off that of the smooth fill
  // that the hole is given with
  float off_colour = 0.0f;
  // In [0, 1]: what is bland differs least from anything, so that a source with fewer gradients costs
  // that part of the difference more, and one with some more of them that part less.
  float off_bland = 1.0f;
  // Also where no whole patch is left at the coarsest level; else nothing is copied there.
  bool from_few = true;
  bool from_anywhere = false;  // in the picture; else from around the hole, half its size wide
  std::uint32_t seed = 1;
  // CV_32FC1, 1/m, may be empty: of the ground that a pixel sees, 0 above the horizon. What is
  // copied comes from where the ground is about as near: there things have the same size.
  cv::Mat nearness;
  // CV_8UC1, may be empty: number of the surface that a pixel sees, 0 unknown. What is copied comes
  // from the same one.
  cv::Mat surface;
  static constexpr int kNoPlane = 255;  // number of all surfaces that are no planes
  // CV_8UC1, may be empty: kSky where a pixel sees nothing (the depth image has none, over a large
  // area), kNoSky where it sees something, 0 unknown. Copies of the one do not stand for the other.
  cv::Mat sky;
  static constexpr std::uint8_t kSky = 1, kNoSky = 2;
  // CV_8UC1, may be empty: != 0 where a surface that is hidden is known to go on.
  cv::Mat sure;
  // Of surface k + 1, the homography from pixels to its own coordinates, the third of them its
  // nearness (1/m): copies within it are shifted along it. May be empty; of surfaces without one
  // none. Without `surface` those that repeat themselves are followed.
  std::vector<cv::Matx33d> planes;
  // The first so many of them are what things stand on; along others only what repeats itself is
  // shifted.
  int supports = 0;
};

struct InpaintResult {
  cv::Mat image;  // CV_32FC3, as the input outside the hole
  // CV_16SC2: (u, v) in the input that each hole pixel is a copy of; (-1, -1) elsewhere
  cv::Mat origin;
  // CV_32FC3: what the slow change of a surface's colour adds to a copy's origin at its place
  cv::Mat lift;
  bool patches_found = true;  // false: nothing to copy from, the hole was filled smoothly
};

// Fills a hole with copies of its surroundings so that every patch of the result resembles one of
// them, coarse to fine, with seams evened out in the gradient domain. Copies keep the surroundings'
// grain.
// @param image CV_32FC3, code values
// @param hole CV_8UC1, != 0: to be filled
// @param banned CV_8UC1, != 0: neither filled nor copied from; may be empty
InpaintResult inpaint(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& banned,
                      const InpaintParams& params = {});

// Smooth fill (push-pull): weighted averages at ever coarser scales.
// @param image CV_32FC3 or CV_32FC1
// @param weight CV_32FC1 in [0, 1]: how far each pixel is to be trusted
cv::Mat pushPull(const cv::Mat& image, const cv::Mat& weight);

}  // namespace calipso::render

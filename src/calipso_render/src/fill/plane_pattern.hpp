#pragma once

#include <opencv2/core.hpp>

#include "calipso_render/inpaint.hpp"
#include "fill/lattice.hpp"

namespace calipso::render {

// A support plane that repeats itself.
struct PatternedPlane {
  int label;  // InpaintParams::surface
  const cv::Matx33d& to_plane;
  const Lattice& lattice;  // in the plane's chart
  cv::Mat hole, seen;      // CV_8UC1: where it is, or may be, hidden; where it surely is seen
};

struct PictureToFill {
  const cv::Mat& look;    // CV_32FC3
  const cv::Mat& hole;    // CV_8UC1
  const cv::Mat& source;  // CV_8UC1: what may be copied
};

// Without a depth image: support planes are supposed all below their horizons, and sure nowhere.
InpaintParams supposedSupports(const InpaintParams& params, const cv::Size& size);

// Such a plane is seen wherever the picture repeats itself so, too, and goes on behind the hole from
// there, whatever the depth image says: it is told least of what is dark or polished. Planes found
// in the depth image most of which do so are none.
// @param fewest px of the hole that have to be told so
// @param params surface and sure are set where the plane is; where it was supposed and does not
//   repeat itself surface is unknown
// @return false: there are fewer, nothing is changed
bool followPattern(const PatternedPlane& plane, const PictureToFill& picture, int fewest,
                   InpaintParams& params);

}  // namespace calipso::render

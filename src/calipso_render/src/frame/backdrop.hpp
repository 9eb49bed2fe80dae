#pragma once

#include <opencv2/core.hpp>

#include "frame/drawn_surfaces.hpp"
#include "frame/pixel.hpp"
#include "frame/place_light.hpp"
#include "frame/reflections.hpp"
#include "frame/revealed_place.hpp"
#include "frame/row.hpp"
#include "frame/seen_place.hpp"
#include "frame/shaded_others.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

// What lies behind the drawn surfaces: the frame's own pixels, or the place where it comes to
// light, in the light of now and with what planes mirror now.
class Backdrop {
 public:
  // All of them must outlive this.
  // @param removed CV_8UC1 over the region: pixels of edited objects in the video
  Backdrop(const StagedFrame& frame, const SeenPlace& place, const RevealedPlace& revealed,
           const Reflections& reflections, const ShadedOthers& others,
           const DrawnSurfaces& surfaces, const EdgeCoverage& edges, const PlaceLight& light,
           const cv::Mat& removed);

  // A pixel of the picture.
  Pixel at(int u, int v) const;
  // What comes to light at a pixel, without what the planes mirror now.
  cv::Vec3f unmirroredAt(int u, int v) const { return shadowedAt(u, v, true).colour; }
  // Pixels [first, last) of the region's row of picture row v, where no object is seen.
  void compose(int v, int first, int last, Row& row) const;

 private:
  Pixel groundAt(int u, int v, bool removed) const;
  Pixel shadowedAt(int u, int v, bool removed) const;
  float coverOfOthers(int u, int v) const;
  void composeRelit(int v, int first, int last, Row& row) const;

  const StagedFrame& frame_;
  const SeenPlace& place_;
  const RevealedPlace& revealed_;
  const Reflections& reflections_;
  const ShadedOthers& others_;
  const DrawnSurfaces& surfaces_;
  const EdgeCoverage& edges_;
  const PlaceLight& light_;
  const cv::Mat removed_;
  const cv::Rect region_;
};

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>

#include "frame/drawn_surfaces.hpp"
#include "frame/place_light.hpp"
#include "frame/reflections.hpp"
#include "frame/row.hpp"
#include "frame/screen.hpp"
#include "frame/shaded_others.hpp"
#include "frame/staged_frame.hpp"
#include "frame/still_pixels.hpp"

namespace calipso::render {

// Tells what has to be done for every pixel of a row.
class RowKinds {
 public:
  // All of them must outlive this.
  // @param removed CV_8UC1 over the region: pixels of edited objects in the video
  RowKinds(const StagedFrame& frame, const Reflections& reflections, const ShadedOthers& others,
           const DrawnSurfaces& surfaces, const EdgeCoverage& edges, const PlaceLight& light,
           const StillPixels& still, const Screen& screen, const cv::Mat& removed);

  // @param v of the picture
  // @param kinds as many as the region has columns
  void find(int v, Kind* kinds) const;

 private:
  void findBehind(int j, int begin, int end, Kind* kinds) const;
  void findSurfaces(int v, Kind* kinds) const;
  void takeStill(int j, Kind* kinds) const;
  void findScreened(int j, Kind* kinds) const;
  void findMirrored(int v, Kind* kinds) const;
  void findShadedOthers(int v, Kind* kinds) const;

  const StagedFrame& frame_;
  const Reflections& reflections_;
  const ShadedOthers& others_;
  const DrawnSurfaces& surfaces_;
  const EdgeCoverage& edges_;
  const PlaceLight& light_;
  const StillPixels& still_;
  const Screen& screen_;
  const cv::Mat removed_;
  const cv::Rect region_;
};

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "fill/pattern.hpp"
#include "fill/plane_chart.hpp"

namespace calipso::render {

constexpr int kOutlineError = 3;  // px by which the outlines of surfaces may be off

// A plane's part of the picture, in its chart.
struct PlanePart {
  PlaneChart chart;
  Pattern pattern;
  cv::Mat plain;  // CV_32FC3, the picture; where the plane is not seen it goes on smoothly
  cv::Mat look;   // CV_32FC3, so, too
  cv::Mat hole, known, source;
  std::vector<cv::Vec4f> edges;  // straightEdges(), of look
};

// A plane that the hole hides.
struct HiddenPlane {
  int label;  // InpaintParams::surface
  const cv::Matx33d& to_plane;
  bool supports;  // something stands on it
  bool known;     // false: where it is hidden its pattern alone can tell
  // CV_8UC1: where it is, or may be, hidden; where it may be copied from; where another surface is
  // seen
  cv::Mat hole, seen, beside;
  std::optional<PlanePart> part;  // nothing if it cannot be filled along itself
};

// CV_32FC1, 1/m, of a picture's pixels.
cv::Mat nearnessOf(const cv::Matx33d& to_plane, const cv::Size& size);

// All but its look and its pattern; nothing if it cannot be filled along itself.
std::optional<PlanePart> chartedPart(const HiddenPlane& plane);

// @param look CV_32FC3, the picture; seen HiddenPlane::seen
void addLook(const cv::Mat& look, const cv::Mat& seen, PlanePart& part);

// @param margin px around what is hidden in which a pattern is sought
void addLattice(const cv::Mat& look, int margin, PlanePart& part);

// Charts a plane's part anew, with its look, so that its stripes lie along the rows: what goes on
// in them is copied along them. @return false: it has none, nothing is changed
bool turnAlongStripes(const cv::Mat& look, HiddenPlane& plane);

}  // namespace calipso::render

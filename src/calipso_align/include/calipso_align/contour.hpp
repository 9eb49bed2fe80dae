#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace calipso::align {

// One closed loop of a silhouette, in order; the last point joins the first. Pixel centres are at
// integer coordinates. All arrays are equally long.
struct ContourLoop {
  std::vector<Eigen::Vector2d> points;  // px
  std::vector<float> confidence;        // 0..1; 0 where unknown
  std::vector<bool> known;              // false: another object or the image border hides the edge
  bool hole = false;                    // an inner loop: the object lies outside of it
};

// The silhouette of one object.
struct ObjectContour {
  std::string object;
  int label = 0;
  std::vector<ContourLoop> loops;  // outer loops first, each kind by falling length
};

struct ContourParams {
  int min_loop_points = 12;    // shorter loops are specks
  double occluder_px = 2.0;    // an edge this close to another object is unknown
  double window_px = 5.0;      // half length of the colour profile across the edge
  double smoothing_px = 4.0;   // half width of the moving least squares fit along the edge
  double max_offset_px = 0.7;  // a refinement that moves the edge further is not believed
  double min_contrast = 12.0;  // grey levels; weaker edges are left where the mask has them
};

// Outlines of one label in `labels` (CV_8U), on the cracks between pixels, about one point per
// pixel, unrefined: known flags set, confidence 0 or 1. On the screen the object lies to the right
// of the direction of travel: outer loops run clockwise, holes counter-clockwise. Diagonal pixels
// count as connected.
std::vector<ContourLoop> traceLoops(const cv::Mat& labels, int label, const ContourParams& params);

// Moves the points along their normals to where the picture (CV_8UC3) changes from the object's
// colour to its surroundings', and smooths by moving least squares that keep corners. Where the
// picture gives no clear edge the mask's is kept, with a low confidence.
void refineLoop(const cv::Mat& image, const cv::Mat& labels, int label, const ContourParams& params,
                ContourLoop& loop);

// traceLoops and refineLoop for one object.
// @throw std::invalid_argument naming the object, when no pixel carries its label
ObjectContour extractContour(const cv::Mat& image, const cv::Mat& labels, int label,
                             const std::string& object, const ContourParams& params = {});

}  // namespace calipso::align

#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/stage.hpp"

namespace calipso::render {

// Walls, steps and whatever else of the place lies off its support planes, per pixel of one view.
// It takes shadows as they do; walls that turn away from the sun take the sky's shade alone.
struct Relief {
  static constexpr int kTile = 8;  // px

  cv::Mat seen;              // CV_8UC1: 255 where it is seen; the others mean nothing elsewhere
  cv::Mat position, normal;  // CV_32FC3, world
  cv::Mat wall;   // CV_8UC1: the wall that it is part of, from 1 on; 0: none, it is curved
  cv::Mat tiles;  // CV_8UC1, one per square of kTile px: 255 where any of it is seen
  Eigen::AlignedBox3f box;  // of all positions
  struct Wall {
    Eigen::Vector3f normal;   // unit
    Eigen::AlignedBox3f box;  // empty: none of it is seen
  };
  std::vector<Wall> walls;

  bool empty() const { return seen.data == nullptr; }
  bool at(int u, int v) const {
    return !empty() && u >= 0 && v >= 0 && u < seen.cols && v < seen.rows &&
           seen.at<std::uint8_t>(v, u) != 0;
  }
  Receiver receiver(int u, int v) const;
  // Is any of it seen in the square that begins at (u, v)? @pre u, v and size are multiples of
  // kTile
  bool touches(int u, int v, int size) const;
  // Does every pixel of a part of the picture see the same wall?
  bool isOneWall(const cv::Rect& part) const;
  // Fills tiles, box and walls from what is seen.
  void index();
};

// The relief as another picture has it. @param map CV_32FC2: where the other's pixels lie in this
// view
Relief warped(const Relief& relief, const cv::Mat& map);

}  // namespace calipso::render

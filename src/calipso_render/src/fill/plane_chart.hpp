#pragma once

#include <opencv2/core.hpp>
#include <optional>

namespace calipso::render {

// A part of a plane of the place as a picture in which all of it is seen alike: the homography to
// the plane, and the affine map after which the middle of a hole keeps its place and its scale.
// Every shift of the plane is a shift of this picture.
struct PlaneChart {
  cv::Matx33d to_chart, to_picture;  // pixels to pixels, homogeneous
  cv::Size size;
  bool tilted;     // the plane is not seen alike all over the hole
  cv::Mat places;  // CV_32FC2: where every pixel of the chart lies in the picture

  // CV_8UC1: 255 where all that is around the place is set in the picture's mask.
  cv::Mat whole(const cv::Mat& mask) const;
  // ... where any of it is.
  cv::Mat any(const cv::Mat& mask) const;
  // Bicubic; of all of the chart, or of a part of it.
  cv::Mat carried(const cv::Mat& image) const;
  cv::Mat carried(const cv::Mat& image, const cv::Rect& part) const;
};

// The chart of the plane around a hole in it. Nothing if the plane is seen from behind.
// @param to_plane the homography from pixels to the plane's coordinates, the third one its nearness
// @param hole, seen CV_8UC1: where the plane is to be filled; where it is seen
// @param direction radians from the chart's rows: what leads so shall lie along them
std::optional<PlaneChart> planeChart(const cv::Matx33d& to_plane, const cv::Mat& hole,
                                     const cv::Mat& seen, double direction = 0.0);

// Where a homography takes a pixel.
inline cv::Point2d taken(const cv::Matx33d& H, double u, double v) {
  const cv::Vec3d x = H * cv::Vec3d(u, v, 1.0);
  return {x[0] / x[2], x[1] / x[2]};
}

}  // namespace calipso::render

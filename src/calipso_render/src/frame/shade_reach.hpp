#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <vector>

#include "frame/staged_frame.hpp"
#include "place/place_view.hpp"

namespace calipso::render {

// Directions in which the sun can stand: a cone.
struct SunRange {
  Eigen::Vector3f axis;  // unit, world
  float angle;           // rad, between axis and side
};

// About the one that was fitted. Where nothing confirms it, it may also be anywhere well above the
// horizon.
std::vector<SunRange> sunRanges(const Eigen::Vector3f& to_sun, bool confirmed,
                                const Eigen::Vector3f& up);

// What encloses an object.
struct Ball {
  Eigen::Vector3f centre;  // world
  float radius;            // m
};

Ball ballAround(const Points& vertices);

// Where an object's shade can lie: the sun is behind its ball, or the ball is so near that it hides
// much of the sky. CV_8UC1, 255; 0 where nothing that takes shade is seen.
cv::Mat shadeReach(const std::vector<Ball>& balls, const std::vector<SunRange>& sun,
                   const PlaceView& place, const cv::Size& size);

// The same of all edited objects that move in the video and no longer follow it, where it has them
// in this frame; empty: anywhere, since that is not known of one of them.
cv::Mat reachOfPassing(const StagedFrame& frame, const PlaceView& place);

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>

#include "texture/sightings.hpp"
#include "texture/texture_fill.hpp"

namespace calipso::render {

// Trust in pixels as a picture of the object alone: less at the mask's rim. CV_32FC1, 0..1
// @param region holds the object's mask and a pixel around it, as far as they lie in the picture
cv::Mat trustOf(const cv::Mat& labels, int index, const cv::Rect& region);

// Trust beside places where one part of the object hides another: there, too, two colours mix.
// @param tolerance m of depth
void lowerBesideJumps(const Camera& camera, float tolerance, Reflectance& r);

// Trust where light steps, at the edge of a cast shadow or at a crease, and the reflectance does,
// too: a fit that is off by a pixel divides the picture by the light beside.
// @param light, open CV_32FC3: shading of a white surface there, and if nothing were before it
void lowerAtSteps(const cv::Mat& light, const cv::Mat& open, Reflectance& r);

// Where details (addDetails()) are seen, and a few pixels around. CV_8UC1; empty: there are none.
cv::Mat besideDetails(const Reflectance& picture, const Surface& surface);

// Whether a place that faces the camera lies where `marks` are not 0.
// @param marks CV_8UC1, of a part of the camera's picture that begins at `corner`; may be empty
bool showsMark(const cv::Mat& marks, const cv::Point& corner, const Camera& camera,
               const Place& place);

// Trust in what the surface's thin details show, such as rails: the mask's rim is all there is.
void trustDetails(const cv::Mat& labels, const Surface& surface, Reflectance& r);

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>

#include "calipso_align/mask_edge.hpp"

// What stands still before an object that goes by behind it: a post, a chair's leg. It was seen as
// background before the object came.
namespace calipso::align {

// Where a part of a picture shows the known background as it was, pieces of at least 5 x 5 px.
// CV_8U, of the picture's size; empty where pictures differ by more than noise all over, as before
// a moving camera.
// @param clear  CV_8U, where no object is
cv::Mat asBefore(const cv::Mat& image, const KnownBackground& background, const cv::Mat& clear,
                 const cv::Rect& part);

// What an object is expected to be and look like; all of one size.
struct ExpectedObject {
  cv::Mat distance;  // CV_32F, px from its outline, negative inside
  cv::Mat look;      // CV_8UC3
  cv::Mat shown;     // CV_8U, != 0: where the look is the object's own
};

// Pixels under an object's outline that are as before, although the object looks otherwise or what
// it looks like there is not known: something stands before it. CV_8U
cv::Mat standingBefore(const ExpectedObject& object, const KnownBackground& background,
                       const cv::Mat& as_before, double noise);

}  // namespace calipso::align

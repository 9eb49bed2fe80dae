#pragma once

#include <opencv2/core.hpp>

namespace calipso::align {

// The motion of one layer of a picture, continued beyond it: a robust affine fit to the flow under
// a mask plus what locally remains of it, faded out with the distance from the mask. Near an
// outline flow mixes both sides; a layer's own motion does not.
// flow     CV_32FC2 of the whole picture, px
// support  CV_8U, where the flow is the layer's own
// roi      part of the picture that is wanted
// Returns CV_32FC2 of roi's size; zero without support.
cv::Mat layerMotion(const cv::Mat& flow, const cv::Mat& support, const cv::Rect& roi);

// A picture (any type) seen from where it was: result(x) = image(x + motion(x)), x in roi.
cv::Mat movedBack(const cv::Mat& image, const cv::Mat& motion, const cv::Rect& roi);

}  // namespace calipso::align

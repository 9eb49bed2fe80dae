#pragma once

#include <opencv2/core.hpp>

namespace calipso::align {

// A silhouette put to where the picture supports it.
struct PlacedShape {
  cv::Matx23d map;         // silhouette pixels to picture pixels, as cv::warpAffine takes it
  double agreement = 0.0;  // 0..1: overlap of the placed silhouette with the pixels that favour it
};

// Finds the affine map that puts a silhouette (CV_8U) where it collects most evidence.
// evidence  CV_32F, nats by which a pixel of the picture favours the object over the background
// start     silhouette pixels to picture pixels; the silhouette may reach beyond the picture
// Deterministic: a pattern search with shrinking steps.
PlacedShape placeSilhouette(const cv::Mat& silhouette, const cv::Mat& evidence,
                            const cv::Matx23d& start);

// The same map where silhouette and picture are `factor` times as large.
cv::Matx23d scaled(const cv::Matx23d& map, double factor);

// How much a silhouette favours the object at each pixel: CV_32F, nats, positive inside:
// weight * tanh(depth below its outline / tolerance_px).
cv::Mat shapeOdds(const cv::Mat& silhouette, float weight, float tolerance_px);

}  // namespace calipso::align

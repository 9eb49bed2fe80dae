#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// A frame as drift is sought in it.
struct DriftPicture {
  cv::Mat grey;     // CV_32FC1, code values, smoothed
  cv::Mat covered;  // CV_8UC1, != 0: the place is not seen
};

// Where a picture drifts whose drift is known: the labelling of least cost (graph cut, Boykov &
// Jolly 2001). A place costs what speaks against its label, a border between labels its length, but
// next to nothing along edges that rest: what rests hides what drifts behind it at such.
// @param shifts px, per picture: how far it has come since the first
// @param ground CV_8UC1, may be empty, != 0: what does not clearly drift there rests
// @return CV_8UC1, 255: drifts; empty: the drift does not explain most of what changes
cv::Mat whereDrifting(const std::vector<DriftPicture>& pictures,
                      const std::vector<cv::Point2f>& shifts, const cv::Mat& ground);

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// Tells a pattern's colours from those of single things on it (a badge on a coat):
// these are rare, not all over it, and do not go on all around it as a band does.
class PatternMotifs {
 public:
  // @param colour CV_32FC3, code values: a sample. @param known CV_8UC1, != 0: of it
  PatternMotifs(const cv::Mat& colour, const cv::Mat& known);

  // CV_8UC1, 255: single things in a picture of the same surface, with their rims. What is as small
  // as a spot belongs to the pattern.
  cv::Mat in(const cv::Mat& colour, const cv::Mat& known) const;

 private:
  std::vector<bool> of_motif_;  // per colour: single things have it, hardly anything else
};

}  // namespace calipso::render

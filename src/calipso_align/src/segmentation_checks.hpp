#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "calipso_align/segmentation_level.hpp"

namespace calipso::align {

// All throw std::invalid_argument naming the object, the value and the remedy.
void checkPicture(const cv::Mat& image);
void checkDepth(const cv::Mat& depth, const cv::Size& size);
void checkTargets(const std::vector<SegmentationTarget>& targets, const cv::Size& size);
void checkStrokes(const cv::Mat& strokes, const std::vector<SegmentationTarget>& targets,
                  const cv::Size& size);

// What the user should know of each target whose strokes lie in part where it may not.
std::vector<std::string> strayStrokes(const cv::Mat& strokes,
                                      const std::vector<SegmentationTarget>& targets);

// What the user should know of each target that colours and depth hardly tell from the background.
// costs: of these alone; labels: where the targets were found.
std::vector<std::string> indistinctTargets(const std::vector<SegmentationTarget>& targets,
                                           const std::vector<cv::Mat>& costs,
                                           const cv::Mat& labels);
[[noreturn]] void failWithoutBackground();
[[noreturn]] void failWithoutForeground(const SegmentationTarget& target);

}  // namespace calipso::align

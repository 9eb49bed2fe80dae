#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_align/segmentation_level.hpp"

namespace calipso::align {

// All throw std::invalid_argument naming the object, the value and the remedy.
void checkPicture(const cv::Mat& image);
void checkDepth(const cv::Mat& depth, const cv::Size& size);
void checkTargets(const std::vector<SegmentationTarget>& targets, const cv::Size& size);
void checkStrokes(const cv::Mat& strokes, const std::vector<SegmentationTarget>& targets,
                  const cv::Size& size);
[[noreturn]] void failWithoutForeground(const SegmentationTarget& target);

}  // namespace calipso::align

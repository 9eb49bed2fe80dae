#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_align/alignment.hpp"
#include "calipso_align/contour.hpp"
#include "calipso_align/segmentation.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::align {

// What is found in the key frame.
struct KeyFrame {
  cv::Mat labels;                       // CV_8U: 0 none, else the object's index
  std::vector<ObjectContour> contours;  // in the scene's order of objects
  std::map<int, ModelSurface> models;   // per label, where one could be fitted
  std::vector<std::string> remarks;     // of the segmentation, for the user
  double segmentation_ms = 0.0;         // wall time
  double contour_ms = 0.0;
};

// The scene's objects as the segmenter wants them; depth: of the key frame, where there is one.
// @throw std::runtime_error (mesh file)
std::vector<SegmentationTarget> segmentationTargets(const Scene& scene,
                                                    const std::optional<DepthObservation>& depth);

// A segmenter of the scene's key frame. use_depth: the scene's depth image, where it has one, is of
// this very picture. @throw std::runtime_error naming a file that cannot be read
Segmenter makeSegmenter(const cv::Mat& image, const Scene& scene, bool use_depth);

// Frame 0 (CV_8UC3, BGR). @throw std::runtime_error naming the file
cv::Mat loadKeyImage(const Scene& scene);

// The scene's strokes (CV_8U), empty when it has none. @throw std::runtime_error naming the file
cv::Mat loadStrokes(const Scene& scene);

// Contours of all targets in a label image. @throw std::invalid_argument naming the object
std::vector<ObjectContour> extractContours(const cv::Mat& image, const cv::Mat& labels,
                                           const std::vector<SegmentationTarget>& targets);

// Segments with these strokes (CV_8U or empty) and traces the contours; `image` is the segmenter's.
// @throw std::invalid_argument naming object, value and remedy
KeyFrame segmentKeyFrame(const cv::Mat& image, Segmenter& segmenter, const cv::Mat& strokes);

}  // namespace calipso::align

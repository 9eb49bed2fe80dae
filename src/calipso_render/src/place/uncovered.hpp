#pragma once

#include <opencv2/core.hpp>

#include "calipso_scene/scene.hpp"

namespace calipso::render {

// What another camera sees of the place where something nearer hides it from the key frame.

// CV_8UC1, that camera's view.
// @param nearness of the place in that view, key_nearness in the key frame's: CV_32FC1, 1/m
// @param from_key viewWarp() by it
cv::Mat hiddenAtKey(const cv::Mat& nearness, const Camera& here, const cv::Mat& from_key,
                    const cv::Mat& key_nearness, const Camera& key);

// Holes get colours from beside them, smoothly, of what is no nearer than they are.
// @param nearness of the place, as in the holes
// @param plate CV_32FC3
void continueInto(const cv::Mat& holes, const cv::Mat& nearness, cv::Mat& plate);

}  // namespace calipso::render

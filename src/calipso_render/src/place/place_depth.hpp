#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/clip_sample.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::render {

// How near the place without the objects is: CV_32FC1, 1/m along the optical axis, 0 infinitely
// far. By the depth image where it says something of the place, else by the support planes, else
// infinitely far. What objects hide is no nearer than they are. It is as near as what goes on there
// from beside them, unless at another of the depths around it the frames that look behind them (at
// least three) agree better (plane sweep, Collins 1996).
// @param frames the key frame first, each with its own camera
// @param depth CV_32FC1, m, of the key frame; 0: unknown
// @param margin px around masks that belong to the objects
cv::Mat placeNearness(const std::vector<ClipFrame>& frames, const std::vector<SupportPlane>& planes,
                      const cv::Mat& depth, int margin);

// Whether something hides a place. @param thing, place 1/m
bool isBefore(float thing, float place);

// The values of the nearest pixels of `where`, which has some; those of `where` have their own.
// @param values CV_32FC1
cv::Mat ofNearest(const cv::Mat& values, const cv::Mat& where);

// The same from another camera's view; what the key frame does not show is as near as the farthest
// beside it.
cv::Mat nearnessFrom(const cv::Mat& nearness, const Camera& key, const Camera& to);

// Which pixels of the key frame show something that another camera does not, since the place is
// before it. CV_8UC1.
// @param guessed CV_8UC1, != 0: may lie elsewhere, and is taken to hide nothing
cv::Mat hiddenFrom(const cv::Mat& nearness, const cv::Mat& guessed, const Camera& key,
                   const Camera& to);

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/stage.hpp"

namespace calipso::render {

// Adds to the surfaces what the video shows of their objects and stock models lack, such as rails
// of a bridge: where the mask goes on beyond the model, and the depth image has it nearer to the
// object than to the place behind, a thin body of the mask's shape that hangs on the triangles seen
// beside it (Surface::holds).
// @param key the key frame with the surfaces' actors
// @param models the surfaces'
// @param depth CV_32FC1, m, of the key frame, 0: unknown; empty: nothing is added
// @param nearness CV_32FC1, 1/m: of the place without the objects, 0 infinitely far
// @return whether any has changed
bool addDetails(const View& key, const cv::Mat& depth, const cv::Mat& nearness,
                const std::vector<ObjectModel>& models, std::vector<Surface>& surfaces);

// The details' vertices behind those of the model, where they are not yet there.
// @param vertices world, m
Points withDetails(const Surface& surface, Points vertices);

// Those of the model alone.
Points withoutDetails(const Surface& surface, const Points& vertices);
Triangles modelTriangles(const Surface& surface);

bool isDetail(const Surface& surface, int triangle);

}  // namespace calipso::render

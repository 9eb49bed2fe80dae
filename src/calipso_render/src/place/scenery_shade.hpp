#pragma once

#include <opencv2/core.hpp>

#include "place/passing_shade.hpp"
#include "place/place_relief.hpp"

namespace calipso::render {

// Where what rises above the support planes and stays (a bowl, a wall, a tree) stands before the
// sun, so that objects take none from there. By the depth image, gone on with behind objects where
// no plane is expected; what nobody sees of it hides nothing.
// @param scenery Prepared::scenery @param to_sun unit, world
// @param receiver what takes shade @return CV_8UC1: 255 where it does; empty: nowhere
cv::Mat shadeOfScenery(const cv::Mat& scenery, const PlaceSurfaces& surfaces, const Camera& camera,
                       const Eigen::Vector3f& to_sun, const ReceiverOf& receiver);

}  // namespace calipso::render

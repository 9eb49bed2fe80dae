#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_render/light_fit.hpp"
#include "calipso_render/stage.hpp"

namespace calipso::render {

// A sun that is nearly known, such that the borders of the shadows that it casts on the support
// planes lie where the pictures show them: each is sought across itself, as a step of brightness,
// and by linear least squares
//   o_i = g_i . t
//   o  px from where it is expected, outwards    g  by how much it moves with t
//   t  rad by which the sun moves, along two axes, near 0 before anything is seen
// The farther a border moves with the sun, the softer the sun's disc makes it.
// nullopt: too few plain borders are seen.
// @param depth CV_32FC1, m, of the first view, 0: unknown; may be empty
// @param blur px, of sharp outlines in the pictures: outlineBlur()
std::optional<SunByBorders> sunByBorders(const std::vector<View>& views,
                                         const std::vector<SupportPlane>& planes,
                                         const cv::Mat& depth, const Eigen::Vector3f& sun,
                                         float blur);

}  // namespace calipso::render

#pragma once

#include <vector>

#include "calipso_render/renderer.hpp"

namespace calipso::render {

// What covers what at the key frame, by models, masks and the depth image.

inline constexpr float kBehind = 1.02f;  // times something's nearness: what it hides is no nearer

// CV_8UC1: 255 where the model covers the picture.
cv::Mat outlineOf(const Actor& actor, const cv::Size& size);

// Grown by a disc, px.
cv::Mat grown(const cv::Mat& mask, int radius);

// Per surface, CV_8UC1: where something that has no model stands before it; empty if nothing does.
std::vector<cv::Mat> frontsOf(const Prepared& p, const RenderParams& params);

// Where the depth image shows something else than a support plane.
// @param scenery CV_32FC1, 1/m, 0 unknown; may be empty
cv::Mat offPlanes(const cv::Mat& scenery, const std::vector<SupportPlane>& planes,
                  const Camera& camera);

// CV_8UC1: the outermost pixels of what stands on the planes, which sceneryOf() leaves to what is
// behind it. No shade falls on them as on the plane.
// @param off_planes offPlanes() of the scenery
// @pre there is a depth image
cv::Mat rimsOff(const cv::Mat& off_planes, const Prepared& p, const RenderParams& params);

// CV_8UC1: among narrow things, such as blades of grass, that stand before the foot of an object at
// rest, beside its model. What would be seen of the ground between them lies under the object.
// @pre there is a depth image
cv::Mat bladesBefore(const Prepared& p, const RenderParams& params);

// All that a resting object covers at the key frame: its mask, which can miss thin or dark ends,
// its model, and what remains along the rim of both. Empty for those that move.
// @param picture CV_32FC3, code values: the key frame; margin px around footprints that go with them
std::vector<cv::Mat> footprintsOf(const Prepared& p, const cv::Mat& picture, int margin);

// CV_8UC1: of Prepared::fronts what is not known to be scenery, stands well before the planes, and
// lies in the sun past the objects: the plane behind it may be in their shadow, it is not.
cv::Mat frontsInSun(const Visibility& sun, const RenderParams& params, const Prepared& p);

// CV_8UC1: 255 where the depth image shows something nearer than the object beside it in the picture:
// it stands before that and does not go on behind it.
// @param scenery sceneryOf() @param depth CV_32FC1, m, 0: unknown
cv::Mat beforeObjects(const cv::Mat& scenery, const cv::Mat& depth, const cv::Mat& labels);

// CV_32FC1, 1/m: what the depth image shows beside the objects, as near as all of its surroundings:
// its edges are not exact.
cv::Mat sceneryOf(const cv::Mat& depth, const Prepared& p, int margin);

}  // namespace calipso::render

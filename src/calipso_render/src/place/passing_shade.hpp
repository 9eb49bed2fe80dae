#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_render/background.hpp"
#include "calipso_render/stage.hpp"

namespace calipso::render {

// The shade that objects which move in the video cast on the place.
struct PassingCast {
  const std::vector<Surface>& surfaces;
  const std::vector<bool>& moves;  // per surface
  Eigen::Vector3d to_sun;          // unit, world
  double sun_radius;               // rad
  Eigen::Vector3d up;              // unit, world: the support planes' normal
};

// What takes it, of the place as the key frame's camera sees it: pixel -> surface point.
using ReceiverOf = std::function<std::optional<Receiver>(int u, int v)>;

// Of the brightest that the frames show of every pixel, the visible part of sun and sky, 0..1,
// CV_32FC1: 1 where one shows it past all of the objects' shade; and CV_8UC1: 255 where none does,
// within the prediction's error. All empty if nothing is known to move. `told`: what the shade tells of
// the sun (place/unseen_casters.hpp).
struct ShadeThatStays {
  cv::Mat sun, sky, never_lit, told;
};

// Takes the frames in which a place is predicted to lie in shade, or to get less of the sky than in
// others, out of its median, if they are darker there than the others. So shade is known also where
// it lies for most of the video.
// @param frames as seen from the key frame's camera, with poses
ShadeThatStays leaveOutPassingShade(const std::vector<ClipFrame>& frames, const PassingCast& cast,
                                    const ReceiverOf& receiver, const BackgroundParams& params,
                                    Background& background);

}  // namespace calipso::render

#pragma once

#include <vector>

#include "calipso_render/renderer.hpp"
#include "calipso_render/shadow_map.hpp"

namespace calipso::render {

// What the clip and its light say of the place, before anything is invented.
struct PlaceEvidence {
  const std::vector<ClipFrame>& frames;  // in the key frame's view
  const std::vector<View>& views;
  const std::vector<Actor>& actors;  // at the key frame
  const Background& seen;
  const cv::Mat& picture;  // CV_32FC3, code values: the key frame, steadied
  const Visibility &sun, &sky;
  const Visibility &sun_past_resting, &sky_past_resting;  // what moves in the video left out
  bool camera_moves;
};

// Takes objects, shadows and reflections out and invents what is hidden: relief, shadowless,
// mirror, background, plate_linear and umbra of `p`, whose surfaces, light, footprints and scenery
// are known.
void prepareBackground(const PlaceEvidence& evidence, const RenderParams& params, Prepared& p);

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/background.hpp"
#include "calipso_render/stage.hpp"

namespace calipso::render {

// What the light is sought in.
struct LightPictures {
  std::vector<View> views;  // the key frame's first
  Background plate;         // as of lightEvidence(): its plate, count and spread; may be empty
  cv::Mat depth;            // CV_32FC1, m, of the key frame, 0: unknown; may be empty
  float blur = 0.0f;        // px, of sharp outlines in the key frame: outlineBlur()
};

// Pictures that are larger than about 640 px are brought down to that: there rims, penumbrae,
// highlights and errors of masks and models have the size in pixels that they are judged by, and
// light needs no more.
LightPictures atWorkingSize(LightPictures pictures);

}  // namespace calipso::render

#pragma once

#include "frame/passing_shadows.hpp"
#include "frame/removed.hpp"
#include "frame/rest_picture.hpp"
#include "frame/resting_light.hpp"

namespace calipso::render {

// What a renderer keeps from frame to frame.
struct FrameCaches {
  RestingLight light;
  PlateInView plate;  // in the key frame's view; empty until it is wanted
  RestPicture rest;
  ShownPixels shown;
};

}  // namespace calipso::render

#pragma once

#include "calipso_scene/scene.hpp"

namespace calipso {

// The camera that the objects are placed before is the one that takes the pictures.
// video: of the first frame, by camera_info and tf
// @throw std::runtime_error naming size, calibration or place of both cameras, how far apart they
// see what is there, and the remedy
void checkSameCamera(const Scene& scene, const Camera& video);

}  // namespace calipso

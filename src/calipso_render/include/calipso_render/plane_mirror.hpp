#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// How the support planes (water, polished floors) mirror what stands on them: established from the
// objects' mirror image in the key frame, nothing where that is not seen.
struct PlaneMirror {
  float strength = 0.0f;   // part of a whole mirror's reflection
  cv::Vec3f surroundings;  // linear; what is mirrored where no object is
  // standard deviation of the planes' slope, by waves or roughness: it draws reflections out
  float slope = 0.0f;
  cv::Mat off;       // CV_8UC1: 255 where something else than a plane is seen
  cv::Mat at_key;    // CV_32FC3, linear: what the objects at rest add to the key frame
  cv::Mat lost;      // CV_8UC1: 255 where nothing of the plane is left in that; may be empty
  cv::Rect key_box;  // beyond it they add nothing

  bool established() const { return strength > 0.0f; }
};

}  // namespace calipso::render

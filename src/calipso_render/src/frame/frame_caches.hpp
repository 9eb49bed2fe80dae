#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/stage.hpp"
#include "calipso_render/visibility.hpp"
#include "frame/plane_sky.hpp"
#include "frame/square_mask.hpp"

// What a renderer keeps from frame to frame.

namespace calipso::render {

// What a frame is compared with to find shadows that pass in the video, in one camera's view.
struct PlateInView {
  cv::Mat codes;   // CV_8UC3
  cv::Mat darker;  // CV_8UC1: a frame's grey value, averaged over 5 x 5 px, below it is in shadow
  // CV_8UC1: 255 = seen in other frames, always alike, and neither what drifts nor, as far as a
  // depth image tells, the sky
  cv::Mat quiet;
};

// Light that stays the same while the same objects are edited under the same camera. Pictures are
// CV_8U of the whole frame: lightLevel() of sun or sky on support plane or relief there.
struct ShadowCache {
  std::vector<bool> edited;  // per surface: which ones it is for
  Camera camera;
  Eigen::Vector3f sun = Eigen::Vector3f::Zero();  // direction
  std::vector<Points> others_vertices;            // of what is not edited
  std::unique_ptr<Visibility> others;             // what they hide of the sun
  // of the edited objects where the video has them; null: of none
  std::unique_ptr<Visibility> originals;
  cv::Mat others_sun, others_sky;  // of the others; empty: nothing else casts a shadow
  cv::Mat originals_sun;           // of the edited objects where the video has them
  SkyGrid originals_sky;
  cv::Mat originals_sky_levels;
  SquareMask sunless;              // squares that originals_sun is not known to be all lit in
  cv::Mat sun_before, sky_before;  // of both together; of the relief in plane terms
  cv::Mat takes;                   // 255 = support plane or relief is seen, on which light changes
  cv::Rect footprints;             // of what the edited objects cover at the key frame
  cv::Mat shaded;                  // CV_8UC1, 255 = darkened by them, grown by the shadow's margin
  cv::Rect shaded_box, bounds;     // of `shaded`; of all that the originals' shadows can reach
  PlateInView plate;               // in the key frame's view; empty until it is wanted
};

// Edited objects drawn where the video has them, which stays the same while the same ones are
// edited.
struct RestPicture {
  std::vector<bool> edited;
  // CV_32FC3: what they add to a pixel, linear; negative where the video does not show them
  cv::Mat drawn;
  cv::Mat passing;  // CV_32FC3: part of the background's light that passes beside them
  cv::Mat owners;   // CV_16SC1: surface that is seen there, or nearest; -1 = none
  cv::Mat reach;    // CV_8UC1: 255 where what drawing misses can be carried to
  cv::Rect box;     // of what `drawn` has
};

}  // namespace calipso::render

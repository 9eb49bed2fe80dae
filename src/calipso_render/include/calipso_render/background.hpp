#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/clip_sample.hpp"
#include "calipso_render/drifting_background.hpp"
#include "calipso_render/inpaint.hpp"
#include "calipso_render/live_fill.hpp"
#include "calipso_render/passing_things.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::render {

// The place without the objects, seen from the key frame's camera.
struct Background {
  cv::Mat plate;   // CV_32FC3, code values
  cv::Mat count;   // CV_8UC1: frames of the sample in which the pixel was seen (at most 255)
  cv::Mat spread;  // CV_32FC1: median absolute deviation over time, code values
  // code values of spread up to which a place rests: what the camera's noise makes of still ones
  float resting_spread = 0.0f;
  // CV_8UC1, may be empty: != 0 where moving objects are predicted to cast shade at times, so that
  // `spread` does not tell whether the place itself moves
  cv::Mat shaded_at_times;
  cv::Mat invented;  // CV_8UC1: 255 where no frame shows it
  cv::Mat origin;    // CV_16SC2: where an invented pixel was copied from; (-1, -1) elsewhere
  LiveFill live;     // where an invented pixel's origin moves by itself; empty if nothing moves
  PassingThings passing;        // of which it has no copies
  DriftingBackground drifting;  // the part of it that drifts as a whole
  double filling_ms = 0.0;      // wall time in which what is invented was filled
};

// The place without the objects from another camera, for what lies beside the key frame's picture.
struct PlateBeside {
  Camera camera;
  cv::Mat nearness;  // CV_32FC1, 1/m
  cv::Mat plate;     // CV_32FC3, linear
  cv::Mat spread;    // CV_32FC1, as Background's; infinite where no frame shows it
};

struct BackgroundParams {
  // masks are grown by this: mixed pixels and compression belong to the object
  int mask_margin_px = 3;
  // predicted shadows are grown by this: penumbra, errors of light and model
  int shadow_margin_px = 7;
  // a pixel darker by more than this fraction may be shaded by an object
  double shadow_step = 0.06;
};

// Temporal median of every pixel over the frames in which no object covers it (masks grown),
// refined to the mean of the values around the median. `objects_move`: darker groups of values are
// taken for the passing objects' shadows and left out. Nothing is invented: where count is 0 the
// plate is 0.
// @param frames all as seen from the key frame's camera; outside the picture labels are 255
Background seenBackground(const std::vector<ClipFrame>& frames, bool objects_move,
                          const BackgroundParams& params = {});

// Frames of a camera that moves lie over each other but for the errors of what is known of depths:
// where their values differ, a mean is blurred. There the plate takes the value of the earliest
// frame that agrees with the others, which shows the place most as the key frame does.
void sharpenSeen(const std::vector<ClipFrame>& frames, const BackgroundParams& params,
                 Background& background);

// Fills what was never seen, and `shaded` (CV_8UC1, may be empty: pixels that the objects cover or
// darken in every frame), from the surroundings. Where the place moves by itself, the median is no
// picture of it: there the key frame is what the surroundings look like.
// @param place its nearness (groundNearness()), surfaces and planes
void inventBackground(const cv::Mat& shaded, const ClipFrame& key, const InpaintParams& place,
                      const BackgroundParams& params, Background& background);

// CV_32FC1, 1/m along the optical axis, of the support plane that a pixel sees, or of what is seen
// of the scenery beyond it; 0 where no plane is. Empty if none is seen at all.
// @param scenery CV_32FC1, 1/m, 0: unknown; may be empty
cv::Mat groundNearness(const std::vector<SupportPlane>& planes, const Camera& camera,
                       const cv::Mat& scenery);

// The key frame with its noise averaged away where the sample shows the same thing all the time
// (same label, value within the noise); elsewhere the key frame itself. CV_32FC3, code values.
// @param moving  CV_8UC1, 255: what moves or sways is seen in the key frame; its shade creeps by
//                less than the noise from frame to frame, and averages to another
// @param steadiness CV_8UC1 out: number of frames averaged, 1..255
cv::Mat steadyKeyFrame(const std::vector<ClipFrame>& frames, const cv::Mat& moving,
                       cv::Mat& steadiness);

}  // namespace calipso::render

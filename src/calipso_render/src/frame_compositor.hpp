#pragma once

#include <algorithm>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "calipso_render/renderer.hpp"

namespace calipso::render {

// Shadow maps that stay the same while the same objects are edited.
struct ShadowCache {
  std::vector<bool> edited;              // per surface: which ones the maps are for
  std::unique_ptr<Visibility> others;     // of what is not edited
  std::unique_ptr<Visibility> originals;  // of the edited objects where the video has them
  std::unique_ptr<Visibility> originals_sky;  // the same against the sky above the support plane
};

inline float smoothStep(float from, float to, float x) {
  const float t = std::clamp((x - from) / (to - from), 0.0f, 1.0f);
  return t * t * (3.0f - 2.0f * t);
}

inline cv::Mat disc(int radius) { return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1}); }

// One frame on its way: stages the objects, finds what an edit can change, and composes those pixels.
class FrameCompositor {
 public:
  FrameCompositor(const Prepared& prepared, const RenderParams& params, const FrameInput& frame, ShadowCache& shadows);

  FrameOutput run();

 private:
  // What lies behind the drawn objects at a pixel.
  struct Behind {
    cv::Vec3f colour;        // linear
    float fresh = 0.0f;      // part of it that carries no camera noise yet
    Provenance source = kOriginal;
  };
  // What a drawn surface adds to a pixel.
  struct Drawn {
    cv::Vec3f colour;
    float cover = 0.0f;
  };

  void stage();
  bool restsAt(int surface) const;
  void prepareShadows();
  void chooseRegion();
  void findRemoved();
  void findPassingShadows();
  void drawVisibility();
  void findStill();
  void keepRims(const cv::Mat& owner);
  void measureSky();
  void measureSun();
  void findRelit();
  cv::Mat originalOf(int surface) const;
  void composePixel(int u, int v, FrameOutput& out) const;
  Behind behindAt(int u, int v) const;
  Behind revealedAt(int u, int v) const;
  Drawn drawnAt(int u, int v) const;
  bool hiddenByFront(int surface, int u, int v) const;
  bool isDrawn(std::uint32_t id, int u, int v) const;
  cv::Vec3f shadeSurface(std::uint32_t id, float u, float v) const;
  float stillness(std::uint32_t id, float u, float v) const;
  float newSun(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const;
  // Part of its brightness that a support plane keeps when it sees these parts of sun and sky.
  cv::Vec3f shadowRatio(float sun, float sky) const;
  cv::Rect shadowBounds(const Points& vertices) const;

  const Prepared& prepared_;
  const RenderParams& params_;
  const FrameInput& frame_;
  ShadowCache& shadows_;

  std::vector<cv::Mat> footprints_;   // Prepared::footprints, likewise
  std::vector<cv::Mat> fronts_;       // Prepared::fronts, where the camera stands as at the key frame
  cv::Mat labels_, plate_;            // of this frame's view
  cv::Mat invented_;
  cv::Mat live_origin_;  // Background::live_origin, where the camera stands as at the key frame
  std::vector<const ObjectInFrame*> states_;  // per surface; nullptr: as in the video, at rest
  std::vector<bool> edited_;                  // per surface
  std::vector<bool> at_rest_;                 // per surface: the video has it where the key frame has it
  std::vector<Actor> actors_;                 // visible ones, per slot
  std::vector<int> surface_of_slot_;
  std::vector<ScreenMesh> observed_;          // per slot: where the video has it (edited objects at rest only)
  std::unique_ptr<Visibility> moved_shadow_;   // of the edited objects where they are now
  std::unique_ptr<Visibility> moved_sky_;
  cv::Rect region_;
  cv::Mat passing_;  // CV_8UC1, whole picture: shaded now by an edited object that moves in the video
  cv::Mat removed_;  // CV_8UC1 over region_: pixels of edited objects in the video
  cv::Mat sky_now_, sky_before_;  // CV_32FC1, at least region_: part of the sky that a support plane sees
  cv::Mat sun_now_, sun_before_;  // CV_32FC1 over region_: the same of the sun; negative where there is no plane
  cv::Mat shaded_;   // CV_32FC1 over region_: 1 = the edited objects darken it in the video
  cv::Mat relit_;    // CV_32FC1 over region_: 1 = the original's shadow, to be taken from the plate
  cv::Mat still_;    // CV_32FC1 over region_: 1 = nothing moved here
  std::optional<VisibilityBuffer> centre_;
  std::optional<EdgeCoverage> edges_;
  Eigen::Vector3f eye_;
  NoiseField noise_;
};

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/live_fill.hpp"
#include "frame/staged_frame.hpp"
#include "place/place_view.hpp"

namespace calipso::render {

// The place without the objects, as a frame's camera sees it at its time. Pictures are of the whole
// frame.
struct SeenPlace {
  explicit SeenPlace(const StagedFrame& frame);

  cv::Mat plate;     // CV_32FC3, linear
  cv::Mat invented;  // CV_8UC1: no frame shows it
  cv::Mat drifts;    // CV_8UC1, key frame's view: the plate drifts along; may be empty
  cv::Mat from_key;  // viewWarp(); empty: the key frame's view
  PlaceView view;    // what takes shadows
  // CV_32FC1, Background::spread of what lies beside the key frame's picture, infinite elsewhere;
  // may be empty
  cv::Mat spread_beside;
  cv::Mat shadowless;  // Prepared::shadowless
  cv::Mat sunless;     // Prepared::sunless
  cv::Mat umbra;       // Prepared::umbra
  cv::Mat veil;        // Prepared::veil
  // From the key frame's camera alone; elsewhere empty
  std::vector<cv::Mat> fronts;      // Prepared::fronts
  std::vector<cv::Mat> footprints;  // Prepared::footprints
  const LiveFill* live = nullptr;   // Background::live

  bool takesShadow(int u, int v) const {
    return view.sees(u, v) && (shadowless.empty() || shadowless.at<std::uint8_t>(v, u) == 0);
  }
  // Something without a model stands in front: it hid the object at the key frame, and goes on
  // doing so.
  bool hides(int surface, int u, int v) const {
    return !fronts[surface].empty() && fronts[surface].at<std::uint8_t>(v, u) != 0;
  }

 private:
  void driftTo(const StagedFrame& frame);
  void takeKeyView(const StagedFrame& frame);
  void warp(const StagedFrame& frame);
  void lookBeside(const StagedFrame& frame);
};

}  // namespace calipso::render

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
  cv::Mat scenery;     // Prepared::scenery
  // Prepared::fronts and ::footprints; from other cameras than the key frame's those of edited
  // objects at rest, by their models alone
  std::vector<cv::Mat> fronts, footprints;
  const LiveFill* live = nullptr;  // Background::live; from the key frame's camera alone

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
  void warpScenery(const StagedFrame& frame, const cv::Mat& nearness);
  void findCover(const StagedFrame& frame, std::size_t surface);
  void lookBeside(const StagedFrame& frame);
  void uncover(const StagedFrame& frame, const cv::Mat& nearness);
};

}  // namespace calipso::render

#include "frame/seen_place.hpp"

#include <limits>
#include <opencv2/imgproc.hpp>

#include "place/key_cover.hpp"
#include "place/place_depth.hpp"
#include "place/plate_beside.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {

SeenPlace::SeenPlace(const StagedFrame& frame)
    : plate(frame.prepared.plate_linear),
      invented(frame.prepared.background.invented),
      view(PlaneView(frame.params.planes, frame.input.camera)),
      fronts(frame.prepared.surfaces.size()),
      footprints(frame.prepared.surfaces.size()) {
  driftTo(frame);
  if (frame.at_key_camera)
    takeKeyView(frame);
  else
    warp(frame);
}

void SeenPlace::driftTo(const StagedFrame& frame) {
  const DriftingBackground& drifting = frame.prepared.background.drifting;
  if (const auto shift = drifting.shiftAt(frame.input.stamp_ns)) {
    plate = plate.clone(), invented = invented.clone();
    drifting.draw(*shift, plate, invented);
    if (frame.at_key_camera) {
      const int margin = frame.params.background.mask_margin_px;
      drifting.matchTo(frame.input.bgr, grown(frame.labels != 0, margin), plate);
    }
    drifts = drifting.where();
  } else if (drifting.established()) {
    // Where it has drifted to is not known: what comes to light is filled from the frame at hand.
    invented = invented | drifting.where();
  }
}

void SeenPlace::takeKeyView(const StagedFrame& frame) {
  const Prepared& prepared = frame.prepared;
  live = prepared.background.live.empty() ? nullptr : &prepared.background.live;
  shadowless = prepared.shadowless, sunless = prepared.sunless;
  umbra = prepared.umbra, veil = prepared.veil;
  view = PlaceView(view.planes(), prepared.relief);
  for (std::size_t i = 0; i < fronts.size(); ++i) {
    if (prepared.fronts[i].empty() || (prepared.moves[i] && !frame.at_rest[i])) continue;
    fronts[i] = frame.elsewhere.empty() ? prepared.fronts[i]
                                        : cv::Mat(prepared.fronts[i] & ~frame.elsewhere);
  }
  footprints = prepared.footprints;
}

void SeenPlace::warp(const StagedFrame& frame) {
  const Prepared& prepared = frame.prepared;
  const Camera &key = prepared.camera, &here = frame.input.camera;
  from_key = viewWarp(nearnessFrom(prepared.nearness, key, here), key, here);
  cv::Mat there = plate, invented_there = invented;
  plate = invented = cv::Mat();
  cv::remap(there, plate, from_key, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  cv::remap(invented_there, invented, from_key, cv::noArray(), cv::INTER_NEAREST,
            cv::BORDER_CONSTANT, cv::Scalar(255));
  lookBeside(frame);
  cv::remap(prepared.shadowless, shadowless, from_key, cv::noArray(), cv::INTER_NEAREST,
            cv::BORDER_CONSTANT, cv::Scalar(0));
  if (!prepared.sunless.empty())
    cv::remap(prepared.sunless, sunless, from_key, cv::noArray(), cv::INTER_NEAREST,
              cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::remap(prepared.umbra, umbra, from_key, cv::noArray(), cv::INTER_NEAREST,
            cv::BORDER_REPLICATE);
  if (!prepared.veil.empty())
    cv::remap(prepared.veil, veil, from_key, cv::noArray(), cv::INTER_NEAREST,
              cv::BORDER_REPLICATE);
  view = PlaceView(view.planes(), warped(prepared.relief, from_key));
}

// Takes what lies beside the key frame's picture from the plates of other cameras.
void SeenPlace::lookBeside(const StagedFrame& frame) {
  cv::Mat beside = besidePicture(from_key, frame.whole().size());
  if (frame.prepared.beside.empty() || cv::countNonZero(beside) == 0) return;
  constexpr float kUnknown = std::numeric_limits<float>::infinity();
  spread_beside = cv::Mat(beside.size(), CV_32F, cv::Scalar(kUnknown));
  for (const PlateBeside& other : frame.prepared.beside) {
    if (cv::countNonZero(beside) == 0) break;
    const Camera &there = other.camera, &here = frame.input.camera;
    const cv::Mat map = viewWarp(nearnessFrom(other.nearness, there, here), there, here);
    cv::Mat colour, spread;
    cv::remap(other.plate, colour, map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    cv::remap(other.spread, spread, map, cv::noArray(), cv::INTER_NEAREST, cv::BORDER_CONSTANT,
              cv::Scalar(kUnknown));
    const cv::Mat shown = beside & (spread < kUnknown);
    colour.copyTo(plate, shown), spread.copyTo(spread_beside, shown);
    invented.setTo(0, shown), beside.setTo(0, shown);
  }
}

}  // namespace calipso::render

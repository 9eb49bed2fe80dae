#include "frame/seen_place.hpp"

#include <limits>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "place/key_cover.hpp"
#include "place/place_depth.hpp"
#include "place/plate_beside.hpp"
#include "place/uncovered.hpp"
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
  // Frames that a moving camera takes from elsewhere have none: what is invented would jump.
  if (!prepared.camera_moves && !prepared.background.live.empty()) live = &prepared.background.live;
  shadowless = prepared.shadowless, sunless = prepared.sunless;
  umbra = prepared.umbra, veil = prepared.veil, scenery = prepared.scenery;
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
  const cv::Mat nearness = nearnessFrom(prepared.nearness, key, here);
  from_key = viewWarp(nearness, key, here);
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
  warpScenery(frame, nearness);
  for (std::size_t i = 0; i < prepared.moves.size(); ++i) {
    if (frame.edited[i] && !prepared.moves[i] && prepared.surfaces[i].in_video) findCover(frame, i);
  }
  uncover(frame, nearness);
}

// What nearer things hide from the key frame is as this frame shows it, and where objects hide it
// here, too, as what is beside.
void SeenPlace::uncover(const StagedFrame& frame, const cv::Mat& nearness) {
  const Prepared& prepared = frame.prepared;
  const cv::Mat unknown =
      hiddenAtKey(nearness, frame.input.camera, from_key, prepared.nearness, prepared.camera);
  cv::Mat objects = frame.labels != 0;
  for (const cv::Mat& f : footprints) {
    if (!f.empty()) objects |= f;
  }
  objects = grown(objects, frame.params.background.mask_margin_px);
  for (int v = 0; v < plate.rows; ++v) {
    for (int u = 0; u < plate.cols; ++u) {
      if (unknown.at<std::uint8_t>(v, u) == 0 || objects.at<std::uint8_t>(v, u) != 0) continue;
      for (int c = 0; c < 3; ++c)
        plate.at<cv::Vec3f>(v, u)[c] = linearFromCode(frame.input.bgr.at<cv::Vec3b>(v, u)[c]);
    }
  }
  invented.setTo(0, unknown), invented.setTo(255, unknown & objects);
  continueInto(unknown & objects, nearness, plate);
}

// @param nearness of the place, this view
void SeenPlace::warpScenery(const StagedFrame& frame, const cv::Mat& nearness) {
  if (frame.prepared.scenery.empty()) return;
  cv::Mat known;
  cv::remap(frame.prepared.scenery > 0.0f, known, from_key, cv::noArray(), cv::INTER_NEAREST,
            cv::BORDER_CONSTANT, cv::Scalar(0));
  scenery = cv::Mat::zeros(nearness.size(), CV_32F);
  nearness.copyTo(scenery, known);
}

// What the video shows of an object at rest, also where its mask misses it (thin parts), and what of
// the scenery stands before it.
void SeenPlace::findCover(const StagedFrame& frame, std::size_t surface) {
  const Surface& s = frame.prepared.surfaces[surface];
  const Actor actor = makeActor(s, s.key_vertices, frame.input.camera);
  const VisibilityBuffer seen(frame.whole(), {&actor.screen});
  cv::Mat own = cv::Mat::zeros(frame.labels.size(), CV_32F), front;
  for (int v = 0; v < own.rows; ++v) {
    for (int u = 0; u < own.cols; ++u) {
      if (seen.ids(v)[u] != VisibilityBuffer::kNothing) own.at<float>(v, u) = seen.nearness(v)[u];
    }
  }
  footprints[surface] = own > 0.0f;
  if (scenery.empty()) return;
  front = (own > 0.0f) & (frame.labels == 0) & (scenery > kBehind * own);
  if (cv::countNonZero(front) == 0) return;
  footprints[surface] &= ~front;
  // The object's margin does not reach into it.
  const int margin = frame.params.background.mask_margin_px + 1;
  front |= grown(front, margin) & (frame.labels == 0) & (scenery > kBehind * grown(own, margin));
  fronts[surface] = front;
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

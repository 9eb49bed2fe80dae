#include "frame/passing_shadows.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/inpaint.hpp"
#include "frame/mask_morphology.hpp"
#include "frame/missed_parts.hpp"
#include "frame/shade_reach.hpp"
#include "place/place_samples.hpp"

namespace calipso::render {
namespace {

constexpr float kDarker = 0.97f;  // of the plate's brightness: a passing shadow,
// likewise in another view, to which the plate is carried with small errors
constexpr float kDarkerElsewhere = 0.9f;
constexpr int kLeastPassing = 5;    // px across, and in another view
constexpr int kLeastElsewhere = 9;  // that somewhere within
constexpr int kPassingReach = 12;   // px: an edge that the plate misses looks like a narrow shadow
constexpr int kRimShare = 50;  // of the picture's width: how far a mask may miss a moving object
constexpr int kMargin = 6;     // px around a shadow
constexpr int kHalfLit = 128;  // level of the sun: another object's shadow
// px across: most of them tell whether a place rests, as of few frames some differ by chance
constexpr int kMost = 5;
constexpr int kVoters = 9;  // px of the square whose dark pixels vote on their colour

cv::Mat square(int side) { return cv::Mat::ones(side, side, CV_8U); }

// Keeps where all channels are darkened alike, at most of the dark pixels around: in deep shade the
// noise of one tells little of its colour.
// @param now, plate CV_8UC3
// @param dark CV_8UC1, in and out
void keepDarkenedAlike(const cv::Mat& now, const cv::Mat& plate, cv::Mat& dark) {
  const cv::Rect box = cv::boundingRect(dark);
  if (box.empty()) return;
  cv::Mat shaded, lit;
  cv::blur(now(box), shaded, {5, 5});
  cv::blur(plate(box), lit, {5, 5});
  cv::Mat votes(box.size(), CV_32F, cv::Scalar(0.0f)), inside = dark(box);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < box.height; ++v) {
    for (int u = 0; u < box.width; ++u) {
      if (inside.at<std::uint8_t>(v, u) != 0)
        votes.at<float>(v, u) =
            darkenedAlike(shaded.at<cv::Vec3b>(v, u), lit.at<cv::Vec3b>(v, u)) ? 1.0f : -1.0f;
    }
  }
  cv::blur(votes, votes, {kVoters, kVoters});
  inside &= votes > 0.0f;
}

// Where the place rests, of the key frame's view. Where shade passes at times, it spreads anyhow,
// and what is around tells.
cv::Mat restingPlaces(const Background& background) {
  cv::Mat rests;
  cv::medianBlur((background.count > 0) & (background.spread < background.resting_spread), rests,
                 kMost);
  if (background.shaded_at_times.empty()) return rests;
  const cv::Mat shaded = background.shaded_at_times & (background.count > 0);
  cv::Mat part, told;
  rests.convertTo(part, CV_32F, 1.0 / 255.0);
  cv::Mat(background.shaded_at_times == 0).convertTo(told, CV_32F, 1.0 / 255.0);
  cv::Mat(pushPull(part, told) > 0.5f).copyTo(rests, shaded);
  return rests;
}

// A mask of the key frame's view in the frame's.
cv::Mat inView(const cv::Mat& at_key, const SeenPlace& place) {
  if (place.from_key.empty()) return at_key;
  cv::Mat here;
  cv::remap(at_key, here, place.from_key, cv::noArray(), cv::INTER_NEAREST, cv::BORDER_CONSTANT,
            cv::Scalar(0));
  return here;
}

// PlateInView::rests and quiet
void findQuiet(const StagedFrame& frame, const SeenPlace& place, PlateInView& plate) {
  const Prepared& p = frame.prepared;
  cv::Mat at_key = restingPlaces(p.background);
  if (p.background.drifting.established()) at_key.setTo(0, p.background.drifting.where());
  plate.rests = inView(at_key, place);
  plate.quiet = plate.rests.clone();
  if (!p.scenery.empty() && !p.nearness.empty()) plate.quiet &= inView(p.nearness > 0.0f, place);
  if (place.from_key.empty() || place.spread_beside.empty()) return;
  const cv::Mat beside = place.spread_beside < p.background.resting_spread;
  plate.rests |= beside, plate.quiet |= beside;
}

PlateInView plateInView(const StagedFrame& frame, const SeenPlace& place) {
  const bool same_view = frame.at_key_camera;
  PlateInView plate;
  if (same_view)
    frame.prepared.background.plate.convertTo(plate.codes, CV_8U);
  else
    plate.codes = codeFromLinear(place.plate);
  cv::cvtColor(plate.codes, plate.darker, cv::COLOR_BGR2GRAY);
  cv::blur(plate.darker, plate.darker, {5, 5});
  plate.darker.convertTo(plate.darker, CV_8U, same_view ? kDarker : kDarkerElsewhere);
  findQuiet(frame, place, plate);
  return plate;
}

// Takes out what is too narrow for a shadow.
void keepWide(bool same_view, cv::Mat& dark) {
  cv::morphologyEx(dark, dark, cv::MORPH_OPEN, square(kLeastPassing));
  if (same_view) return;
  cv::Mat broad;
  cv::morphologyEx(dark, broad, cv::MORPH_OPEN, square(kLeastElsewhere));
  cv::dilate(broad, broad, square(2 * kPassingReach + 1));
  dark &= broad;
}

// What other objects shade stays theirs, where it is known.
void takeOutOthers(const StagedFrame& frame, const cv::Mat& others_sun, cv::Mat& dark) {
  if (others_sun.empty() || !frame.prepared.light.confirmed()) return;
  cv::Mat shaded;
  cv::dilate(others_sun < kHalfLit, shaded, disc(frame.params.background.shadow_margin_px));
  dark.setTo(0, shaded);
}

// The rim that the mask of another moving object has missed is no shadow.
void takeOutRims(const StagedFrame& frame, cv::Mat& dark) {
  for (std::size_t i = 0; i < frame.edited.size(); ++i) {
    if (frame.edited[i] || !frame.prepared.moves[i]) continue;
    cv::Mat away;
    cv::distanceTransform(frame.labels != frame.prepared.surfaces[i].index, away, cv::DIST_L2,
                          cv::DIST_MASK_PRECISE);
    dark.setTo(0, away <= std::max(2, frame.labels.cols / kRimShare));
  }
}

}  // namespace

cv::Mat passingShadows(const StagedFrame& frame, const SeenPlace& place, const cv::Mat& unmirrored,
                       const cv::Mat& others_sun, PlateInView& at_key) {
  if (!frame.movesInVideo()) return {};
  if (frame.at_key_camera && at_key.codes.empty()) at_key = plateInView(frame, place);
  const PlateInView plate = frame.at_key_camera ? at_key : plateInView(frame, place);
  cv::Mat now;
  cv::cvtColor(unmirrored, now, cv::COLOR_BGR2GRAY);
  cv::blur(now, now, {5, 5});
  cv::Mat dark = now < plate.darker;
  dark &= plate.quiet & (frame.labels == 0);
  const cv::Mat reach = reachOfPassing(frame, place.view);
  if (!reach.empty()) dark &= reach;
  keepDarkenedAlike(unmirrored, plate.codes, dark);
  keepWide(frame.at_key_camera, dark);
  takeOutOthers(frame, others_sun, dark);
  dark |= missedParts(frame, plate, unmirrored);
  cv::dilate(dark, dark, disc(kMargin));
  takeOutRims(frame, dark);
  return dark;
}

}  // namespace calipso::render

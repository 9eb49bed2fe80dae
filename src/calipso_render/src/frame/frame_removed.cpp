// The part of FrameCompositor that finds what the video shows of edited objects and of the shadows
// of those that move: pixels behind which the place comes to light.

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "draw/wide_loops.hpp"
#include "frame/frame_compositor.hpp"
#include "frame/mask_morphology.hpp"
#include "frame/shade_reach.hpp"
#include "frame/tiled_filter.hpp"
#include "place/place_samples.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {
namespace {

constexpr float kDarker = 0.97f;  // of the plate's brightness: a passing shadow,
// likewise in another view, to which the plate is carried with small errors
constexpr float kDarkerElsewhere = 0.9f;
constexpr int kLeastPassing = 5;    // px across, and in another view
constexpr int kLeastElsewhere = 9;  // that somewhere within
constexpr int kPassingReach = 12;   // px: an edge that the plate misses looks like a narrow shadow
constexpr int kRimShare = 50;   // of the picture's width: how far a mask may miss a moving object
constexpr int kInFront = 127;   // of a matte
constexpr float kQuiet = 5.0f;  // code values of spread over time: the background rests

// Keeps where all channels are darkened alike.
// @param now, plate CV_8UC3
// @param dark CV_8UC1, in and out
void keepDarkenedAlike(const cv::Mat& now, const cv::Mat& plate, cv::Mat& dark) {
  const cv::Rect box = cv::boundingRect(dark);
  if (box.empty()) return;
  cv::Mat shaded, lit;
  cv::blur(now(box), shaded, {5, 5});
  cv::blur(plate(box), lit, {5, 5});
#pragma omp parallel for schedule(static)
  for (int v = 0; v < box.height; ++v) {
    std::uint8_t* row = dark.ptr<std::uint8_t>(box.y + v) + box.x;
    for (int u = 0; u < box.width; ++u) {
      if (row[u] == 0) continue;
      if (!darkenedAlike(shaded.at<cv::Vec3b>(v, u), lit.at<cv::Vec3b>(v, u))) row[u] = 0;
    }
  }
}

}  // namespace

// PlateInView::quiet
cv::Mat FrameCompositor::quietPlaces() const {
  cv::Mat at_key =
      (frame_.prepared.background.count > 0) & (frame_.prepared.background.spread < kQuiet);
  if (frame_.prepared.background.drifting.established())
    at_key.setTo(0, frame_.prepared.background.drifting.where());
  if (!frame_.prepared.scenery.empty() && !frame_.prepared.nearness.empty())
    at_key.setTo(0, frame_.prepared.nearness == 0.0f);
  if (place_.from_key.empty()) return at_key;
  cv::Mat here;
  cv::remap(at_key, here, place_.from_key, cv::noArray(), cv::INTER_NEAREST, cv::BORDER_CONSTANT,
            cv::Scalar(0));
  return here;
}

PlateInView FrameCompositor::plateInView() const {
  const bool same_view = frame_.at_key_camera;
  PlateInView plate;
  if (same_view)
    frame_.prepared.background.plate.convertTo(plate.codes, CV_8U);
  else
    plate.codes = codeFromLinear(place_.plate);
  cv::cvtColor(plate.codes, plate.darker, cv::COLOR_BGR2GRAY);
  cv::blur(plate.darker, plate.darker, {5, 5});
  plate.darker.convertTo(plate.darker, CV_8U, same_view ? kDarker : kDarkerElsewhere);
  plate.quiet = quietPlaces();
  return plate;
}

// The shadow of an object that moves in the video shows as darkening against the plate.
void FrameCompositor::findPassingShadows() {
  if (!frame_.movesInVideo()) return;
  const bool same_view = frame_.at_key_camera;
  if (same_view && shadows_.plate.codes.empty()) shadows_.plate = plateInView();
  const PlateInView plate = same_view ? shadows_.plate : plateInView();
  cv::Mat now;
  cv::cvtColor(unmirrored_, now, cv::COLOR_BGR2GRAY);
  cv::blur(now, now, {5, 5});
  passing_ = now < plate.darker;
  passing_ &= plate.quiet & (frame_.labels == 0);
  const cv::Mat reach = reachOfPassing(frame_, place_.view);
  if (!reach.empty()) passing_ &= reach;
  keepDarkenedAlike(unmirrored_, plate.codes, passing_);
  cv::morphologyEx(passing_, passing_, cv::MORPH_OPEN,
                   cv::Mat::ones(kLeastPassing, kLeastPassing, CV_8U));
  if (!same_view) {
    cv::Mat broad;
    cv::morphologyEx(passing_, broad, cv::MORPH_OPEN,
                     cv::Mat::ones(kLeastElsewhere, kLeastElsewhere, CV_8U));
    cv::dilate(broad, broad, cv::Mat::ones(2 * kPassingReach + 1, 2 * kPassingReach + 1, CV_8U));
    passing_ &= broad;
  }
  cv::dilate(passing_, passing_, cv::getStructuringElement(cv::MORPH_ELLIPSE, {13, 13}));
  // The rim that the mask of another moving object has missed is no shadow.
  for (std::size_t i = 0; i < frame_.edited.size(); ++i) {
    if (frame_.edited[i] || !frame_.prepared.moves[i]) continue;
    cv::Mat near;
    cv::dilate(frame_.labels == frame_.prepared.surfaces[i].index, near,
               disc(std::max(2, frame_.labels.cols / kRimShare)));
    passing_.setTo(0, near);
  }
}

// The pixels of region_ that show an object in the video.
cv::Mat FrameCompositor::originalOf(int surface) const {
  cv::Mat original = frame_.labels(region_) == frame_.prepared.surfaces[surface].index;
  if (!place_.footprints[surface].empty()) original |= place_.footprints[surface](region_);
  return original;
}

// Row v of the pixels of a box that show an edited object in the video, and of those that show
// another one.
CALIPSO_WIDE_LOOPS void FrameCompositor::findShown(int v, const cv::Rect& box, std::uint8_t* own,
                                                   std::uint8_t* others) const {
  const int width = box.width;
  const std::uint8_t* labels = frame_.labels.ptr<std::uint8_t>(v) + box.x;
  for (int u = 0; u < width; ++u) own[u] = 0, others[u] = labels[u] != 0 ? 255 : 0;
  for (std::size_t i = 0; i < frame_.edited.size(); ++i) {
    if (!frame_.edited[i] || !frame_.prepared.surfaces[i].in_video) continue;
    const std::uint8_t index = static_cast<std::uint8_t>(frame_.prepared.surfaces[i].index);
    for (int u = 0; u < width; ++u)
      own[u] |= labels[u] == index ? 255 : 0, others[u] &= labels[u] == index ? 0 : 255;
    if (place_.footprints[i].empty()) continue;
    const std::uint8_t* footprint = place_.footprints[i].ptr<std::uint8_t>(v) + box.x;
    for (int u = 0; u < width; ++u) own[u] |= footprint[u];
  }
}

// What the edited objects show in the video, with a margin, but not what stands beside them.
void FrameCompositor::findOwn(const cv::Rect& box) {
  cv::Mat own(box.size(), CV_8U), others(box.size(), CV_8U), here = removed_(box - region_.tl());
#pragma omp parallel for schedule(static)
  for (int v = 0; v < box.height; ++v)
    findShown(v + box.y, box, own.ptr<std::uint8_t>(v), others.ptr<std::uint8_t>(v));
  const int margin = frame_.params.background.mask_margin_px;
  filterTiles(own, margin, here, DiscDilation(margin));
  if (!passing_.empty()) here |= passing_(box);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < box.height; ++v) {
    std::uint8_t* row = here.ptr<std::uint8_t>(v);
    const std::uint8_t* stays = others.ptr<std::uint8_t>(v);
    for (int u = 0; u < box.width; ++u) row[u] &= static_cast<std::uint8_t>(~stays[u]);
  }
}

void FrameCompositor::findRemoved() {
  removed_ = cv::Mat::zeros(region_.size(), CV_8U);
  const cv::Rect box = passing_.empty() ? shown_box_ : region_;
  if (!box.empty()) findOwn(box);
  for (const cv::Mat& front : place_.fronts) {
    if (!front.empty()) removed_.setTo(0, front(region_));
  }
  if (!frame_.params.matte.empty() && frame_.at_key_camera)
    removed_.setTo(0, frame_.params.matte(region_) > kInFront);
}

}  // namespace calipso::render

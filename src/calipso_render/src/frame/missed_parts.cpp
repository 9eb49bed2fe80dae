#include "frame/missed_parts.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_render/visibility.hpp"
#include "frame/mask_morphology.hpp"
#include "place/touching_pieces.hpp"

namespace calipso::render {
namespace {

constexpr int kOff = 4;          // px by which a model may be beside its place
constexpr int kAbout = 12;       // px around its mask in which it may be, where no pose is known
constexpr double kUnlike = 2.0;  // times what a place that rests may vary by, in one channel
constexpr int kLeastAcross = 3;  // px
// px up to which something is thin, gaps that it may have, and the part of an object's size by which
// it may stand out from it
constexpr int kThin = 5, kGaps = 2, kReach = 2;
// of its area in the picture: a spout, a button; and the gaps up to which it hangs together, as a
// stem may look like what is behind it
constexpr double kSmall = 0.06;
constexpr int kStem = 5;

// Is an object that the video has here drawn elsewhere, or not at all?
bool isGone(const StagedFrame& frame, std::size_t surface, const Actor& here) {
  for (const StagedObject& object : frame.objects) {
    if (static_cast<std::size_t>(object.surface) != surface) continue;
    const auto &now = object.actor.screen.points, &then = here.screen.points;
    return !std::equal(now.begin(), now.end(), then.begin(), then.end(),
                       [](const Eigen::Vector3f& p, const Eigen::Vector3f& q) {
                         return (p - q).head<2>().norm() < kNonePx;
                       });
  }
  return true;
}

// Adds what lies about a mask.
void addAbout(const cv::Mat& mask, cv::Mat& to) {
  const cv::Rect seen = cv::boundingRect(mask);
  if (seen.empty()) return;
  const cv::Rect box = (seen + cv::Size(2 * kAbout, 2 * kAbout) - cv::Point(kAbout, kAbout)) &
                       cv::Rect({0, 0}, mask.size());
  cv::Mat about;
  cv::dilate(mask(box), about, disc(kAbout));
  to(box) |= about;
}

// Where edited objects that move, and no longer follow the video, are seen in this frame: by their
// models, or about their masks where no pose is known.
struct Outlines {
  cv::Mat all, gone;  // CV_8UC1, whole picture; of those that are gone from there
};

Outlines outlines(const StagedFrame& frame) {
  cv::Mat within = cv::Mat::zeros(frame.labels.size(), CV_8U), gone = within.clone();
  for (std::size_t i = 0; i < frame.edited.size(); ++i) {
    const Surface& surface = frame.prepared.surfaces[i];
    if (!frame.casts(i) || !frame.prepared.moves[i] || !surface.in_video) continue;
    const auto& vertices = frame.observed[i];
    if (!vertices) {
      addAbout(frame.labels == surface.index, within);
      continue;
    }
    const Actor actor = makeActor(surface, *vertices, frame.input.camera);
    const cv::Rect box = boundsOf(actor.screen, kOff + 1, within.size());
    if (box.empty()) continue;
    const VisibilityBuffer buffer(box, {&actor.screen});
    cv::Mat outline = cv::Mat::zeros(box.size(), CV_8U);
    for (int v = 0; v < box.height; ++v) {
      for (int u = 0; u < box.width; ++u) {
        if (buffer.ids(v)[u] != VisibilityBuffer::kNothing) outline.at<std::uint8_t>(v, u) = 255;
      }
    }
    cv::dilate(outline, outline, disc(kOff));
    within(box) |= outline;
    if (isGone(frame, i, actor)) gone(box) |= outline;
  }
  return {within, gone};
}

// Pieces of a mask that are small, gaps passed over.
cv::Mat smallPieces(const cv::Mat& mask, double most) {
  cv::Mat joined, pieces, small = cv::Mat::zeros(mask.size(), CV_8U);
  cv::dilate(mask, joined, disc(kGaps));
  std::vector<int> area(cv::connectedComponents(joined, pieces), 0);
  const auto forEachPixel = [&](const auto& act) {
    for (int v = 0; v < mask.rows; ++v) {
      for (int u = 0; u < mask.cols; ++u) {
        if (mask.at<std::uint8_t>(v, u) != 0) act(v, u, pieces.at<int>(v, u));
      }
    }
  };
  forEachPixel([&](int, int, int piece) { ++area[piece]; });
  forEachPixel([&](int v, int u, int piece) {
    if (area[piece] <= most) small.at<std::uint8_t>(v, u) = 255;
  });
  return small;
}

// Of what is unlike, what is thin, or small, and goes on from within an outline, as ropes do.
// @param unlike, within CV_8UC1
cv::Mat hanging(const cv::Mat& unlike, const cv::Mat& within) {
  const int area = cv::countNonZero(within);
  if (area == 0) return cv::Mat::zeros(unlike.size(), CV_8U);
  cv::Mat broad, joined;
  cv::morphologyEx(unlike, broad, cv::MORPH_OPEN, cv::Mat::ones(kThin + 1, kThin + 1, CV_8U));
  const cv::Mat thin = unlike & ~broad, small = smallPieces(unlike & ~within, kSmall * area);
  cv::dilate(thin, joined, disc(kGaps));
  const cv::Mat hangs = thin & touchingPieces(joined, within);
  cv::dilate(small, joined, disc(kStem));
  return hangs | (small & touchingPieces(joined, within));
}

}  // namespace

cv::Mat missedParts(const StagedFrame& frame, const PlateInView& plate, const cv::Mat& now) {
  const auto [within, gone] = outlines(frame);
  cv::Mat missed = cv::Mat::zeros(within.size(), CV_8U);
  const cv::Rect outline = cv::boundingRect(within);
  if (outline.empty()) return missed;
  const int reach = std::max(outline.width, outline.height) / kReach;
  const cv::Rect box = (outline + cv::Size(2 * reach, 2 * reach) - cv::Point(reach, reach)) &
                       cv::Rect({0, 0}, within.size());
  cv::Mat here, behind, differs;
  cv::blur(now(box), here, {3, 3}), cv::blur(plate.codes(box), behind, {3, 3});
  cv::absdiff(here, behind, differs);
  std::vector<cv::Mat> c;
  cv::split(differs, c);
  const cv::Mat unlike =
      (frame.labels(box) == 0) &
      (cv::max(c[0], cv::max(c[1], c[2])) > kUnlike * frame.prepared.background.resting_spread);
  cv::morphologyEx(unlike & within(box) & plate.quiet(box), missed(box), cv::MORPH_OPEN,
                   cv::Mat::ones(kLeastAcross, kLeastAcross, CV_8U));
  missed(box) |= hanging(unlike & plate.rests(box), gone(box));
  return missed;
}

}  // namespace calipso::render

#include "frame/missed_parts.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_render/visibility.hpp"
#include "frame/mask_morphology.hpp"

namespace calipso::render {
namespace {

constexpr int kOff = 4;          // px by which a model may be beside its place
constexpr double kUnlike = 2.0;  // times what a place that rests may vary by, in one channel
constexpr int kLeastAcross = 3;  // px

// Where edited objects that move are seen in this frame, by their models.
cv::Mat outlines(const StagedFrame& frame) {
  cv::Mat within = cv::Mat::zeros(frame.labels.size(), CV_8U);
  for (std::size_t i = 0; i < frame.edited.size(); ++i) {
    const Surface& surface = frame.prepared.surfaces[i];
    if (!frame.edited[i] || !frame.prepared.moves[i] || !surface.in_video) continue;
    const auto vertices = frame.observed(static_cast<int>(i));
    if (!vertices) continue;
    const Actor actor = makeActor(surface, *vertices, frame.input.camera);
    const cv::Rect box = boundsOf(actor.screen, kOff + 1, within.size());
    if (box.empty()) continue;
    VisibilityBuffer buffer(box);
    buffer.draw(actor.screen, 0);
    cv::Mat outline = cv::Mat::zeros(box.size(), CV_8U);
    for (int v = 0; v < box.height; ++v) {
      for (int u = 0; u < box.width; ++u) {
        if (buffer.ids(v)[u] != VisibilityBuffer::kNothing) outline.at<std::uint8_t>(v, u) = 255;
      }
    }
    cv::dilate(outline, outline, disc(kOff));
    within(box) |= outline;
  }
  return within;
}

}  // namespace

cv::Mat missedParts(const StagedFrame& frame, const PlateInView& plate, const cv::Mat& now) {
  const cv::Mat within = outlines(frame);
  cv::Mat missed = cv::Mat::zeros(within.size(), CV_8U);
  const cv::Rect box = cv::boundingRect(within);
  if (box.empty()) return missed;
  cv::Mat here, behind, differs;
  cv::blur(now(box), here, {3, 3}), cv::blur(plate.codes(box), behind, {3, 3});
  cv::absdiff(here, behind, differs);
  std::vector<cv::Mat> c;
  cv::split(differs, c);
  const cv::Mat unlike =
      cv::max(c[0], cv::max(c[1], c[2])) > kUnlike * frame.prepared.background.resting_spread;
  cv::morphologyEx(unlike & within(box) & plate.quiet(box) & (frame.labels(box) == 0), missed(box),
                   cv::MORPH_OPEN, cv::Mat::ones(kLeastAcross, kLeastAcross, CV_8U));
  return missed;
}

}  // namespace calipso::render

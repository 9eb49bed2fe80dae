#include "calipso_render/inpaint.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "line_bridge.hpp"
#include "patch_fill.hpp"
#include "seam_blend.hpp"
#include "seam_cut.hpp"

namespace calipso::render {
namespace {

constexpr int kLeastMargin = 48;  // px around the hole that are looked at, at least

cv::Rect windowAround(const cv::Mat& hole) {
  const cv::Rect box = cv::boundingRect(hole);
  const int margin = std::max({kLeastMargin, box.width / 2, box.height / 2});
  const cv::Rect grown(box.x - margin, box.y - margin, box.width + 2 * margin,
                       box.height + 2 * margin);
  return grown & cv::Rect(0, 0, hole.cols, hole.rows);
}

InpaintParams within(const cv::Rect& window, const InpaintParams& params) {
  InpaintParams inner = params;
  if (!params.nearness.empty()) inner.nearness = params.nearness(window).clone();
  if (!params.surface.empty()) inner.surface = params.surface(window).clone();
  return inner;
}

cv::Mat smoothFill(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& known) {
  cv::Mat weight(hole.size(), CV_32F, cv::Scalar(0.0f)), filled = image.clone();
  weight.setTo(1.0f, known);
  pushPull(image, weight).copyTo(filled, hole);
  return filled;
}

// Copies every pixel from its origin. @return CV_8UC1: 255 where it has one
cv::Mat copyFrom(const cv::Mat& origin, const cv::Mat& image, cv::Mat& filled) {
  cv::Mat copied = cv::Mat::zeros(origin.size(), CV_8U);
  for (int v = 0; v < origin.rows; ++v) {
    for (int u = 0; u < origin.cols; ++u) {
      const cv::Vec2s from = origin.at<cv::Vec2s>(v, u);
      if (from[0] < 0) continue;
      filled.at<cv::Vec3f>(v, u) = image.at<cv::Vec3f>(from[1], from[0]);
      copied.at<std::uint8_t>(v, u) = 255;
    }
  }
  return copied;
}

}  // namespace

InpaintResult inpaint(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& banned,
                      const InpaintParams& params) {
  CV_Assert(image.type() == CV_32FC3 && hole.type() == CV_8UC1 && image.size() == hole.size());
  CV_Assert(params.nearness.empty() ||
            (params.nearness.type() == CV_32FC1 && params.nearness.size() == hole.size()));
  InpaintResult result{image.clone(), cv::Mat(image.size(), CV_16SC2, cv::Scalar(-1, -1)), true};
  if (cv::countNonZero(hole) == 0) return result;
  const cv::Rect window = windowAround(hole);
  cv::Mat look = image(window).clone(), to_fill = hole(window) != 0, source = to_fill == 0;
  if (!banned.empty()) source.setTo(0, banned(window));
  const cv::Mat whole_hole = to_fill.clone();
  const LineBridges bridges = bridgeLines(to_fill, source, look);
  to_fill.setTo(0, bridges.core);
  const cv::Mat known = source | bridges.core;
  source.setTo(0, bridges.lines);
  const InpaintParams inner = within(window, params);
  cv::Mat filled = smoothFill(look, to_fill, known),
          origin = patchOrigins(look, to_fill, source, inner);
  cutSeams(look, to_fill, source, known, inner.surface, origin);
  const cv::Mat copied = copyFrom(origin, look, filled);
  result.patches_found = cv::countNonZero(copied) > 0;
  if (result.patches_found) blendSeams(to_fill, known, origin, filled);
  bridges.origin.copyTo(origin, bridges.core);
  cv::Mat(origin + cv::Scalar(window.x, window.y))
      .copyTo(result.origin(window), copied | bridges.core);
  filled.copyTo(result.image(window), whole_hole);
  return result;
}

}  // namespace calipso::render

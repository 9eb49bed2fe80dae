#include "calipso_render/inpaint.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "patch_fill.hpp"
#include "seam_blend.hpp"

namespace calipso::render {
namespace {

constexpr int kLeastMargin = 48;  // px around the hole that are looked at, at least

cv::Mat smoothFill(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& source) {
  cv::Mat weight(hole.size(), CV_32F, cv::Scalar(0.0f)), filled = image.clone();
  weight.setTo(1.0f, source);
  pushPull(image, weight).copyTo(filled, hole);
  return filled;
}

cv::Rect windowAround(const cv::Mat& hole) {
  const cv::Rect box = cv::boundingRect(hole);
  const int margin = std::max({kLeastMargin, box.width / 2, box.height / 2});
  const cv::Rect grown(box.x - margin, box.y - margin, box.width + 2 * margin, box.height + 2 * margin);
  return grown & cv::Rect(0, 0, hole.cols, hole.rows);
}

}  // namespace

InpaintResult inpaint(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& banned,
                      const InpaintParams& params) {
  CV_Assert(image.type() == CV_32FC3 && hole.type() == CV_8UC1 && image.size() == hole.size());
  InpaintResult result{image.clone(), cv::Mat(image.size(), CV_16SC2, cv::Scalar(-1, -1)), true};
  if (cv::countNonZero(hole) == 0) return result;
  const cv::Rect window = windowAround(hole);
  cv::Mat whole_source = hole == 0;
  if (!banned.empty()) whole_source.setTo(0, banned);
  const cv::Mat look = image(window).clone(), to_fill = hole(window) != 0, source = whole_source(window).clone();
  cv::Mat filled = smoothFill(look, to_fill, source), copied;
  const cv::Mat origin = patchOrigins(look, to_fill, source, params);
  for (int v = 0; v < origin.rows; ++v) {
    for (int u = 0; u < origin.cols; ++u) {
      const cv::Vec2s from = origin.at<cv::Vec2s>(v, u);
      if (from[0] >= 0) filled.at<cv::Vec3f>(v, u) = look.at<cv::Vec3f>(from[1], from[0]);
    }
  }
  cv::extractChannel(origin, copied, 0);
  copied = copied >= 0;
  result.patches_found = cv::countNonZero(copied) > 0;
  if (result.patches_found) blendSeams(to_fill, source, origin, filled);
  cv::Mat(origin + cv::Scalar(window.x, window.y)).copyTo(result.origin(window), copied);
  filled.copyTo(result.image(window), to_fill);
  return result;
}

}  // namespace calipso::render

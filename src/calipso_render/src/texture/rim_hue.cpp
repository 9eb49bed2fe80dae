#include "texture/rim_hue.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"

namespace calipso::render {
namespace {

// px: standard deviation of the blur of coded hue, the least of six clips (by their rims 1.2 to 2)
constexpr float kBlur = 1.2f;
constexpr float kReach = 3.0f * kBlur;  // px beyond which nothing is mixed

// The surroundings' share in the hue `depth` px inside of a mask, whose first pixel has depth 1.
float shareAt(float depth) { return 0.5f * std::erfc((depth - 0.5f) / (kBlur * std::sqrt(2.0f))); }

// What a colour has beyond its brightness (Rec. 601, as videos are coded).
cv::Vec3f hueOf(const cv::Vec3f& code) {
  const float brightness = 0.114f * code[0] + 0.587f * code[1] + 0.299f * code[2];
  return code - cv::Vec3f::all(brightness);
}

// px from the nearest pixel that is 0; those beyond the picture are as the ones at its border.
cv::Mat distanceIn(const cv::Mat& mask) {
  cv::Mat padded, distance;
  cv::copyMakeBorder(mask, padded, 1, 1, 1, 1, cv::BORDER_REPLICATE);
  cv::distanceTransform(padded, distance, cv::DIST_L2, 5);
  return distance(cv::Rect(1, 1, mask.cols, mask.rows));
}

}  // namespace

void unmixHue(const cv::Mat& mask, cv::Mat& codes) {
  if (cv::countNonZero(mask == 0) == 0) return;
  const cv::Mat depth = distanceIn(mask), apart = distanceIn(mask == 0);
  cv::Mat pure;
  cv::Mat(cv::min(apart, kReach) / kReach).copyTo(pure);
  cv::pow(pure, 4.0, pure);
  const cv::Mat around = pushPull(codes, pure);
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) {
      const float d = depth.at<float>(v, u);
      if (d <= 0.0f || d > kReach) continue;
      cv::Vec3f& code = codes.at<cv::Vec3f>(v, u);
      const float share = shareAt(d);
      code += (share / (1.0f - share)) * (hueOf(code) - hueOf(around.at<cv::Vec3f>(v, u)));
      for (int c = 0; c < 3; ++c) code[c] = std::clamp(code[c], 0.0f, 255.0f);
    }
  }
}

}  // namespace calipso::render

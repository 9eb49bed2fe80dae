#include "calipso_align/mask_edge.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

namespace calipso::align {
namespace {

constexpr int kReach = 4;  // px; how far off the colours of either side are looked for

// Mean colour of the pixels under `pure` close to p.
std::optional<cv::Vec3f> meanNear(const cv::Mat& image, const cv::Mat& pure, const cv::Point& p) {
  cv::Vec3f sum(0, 0, 0);
  float total = 0.0f;
  for (int y = std::max(0, p.y - kReach); y <= std::min(pure.rows - 1, p.y + kReach); ++y)
    for (int x = std::max(0, p.x - kReach); x <= std::min(pure.cols - 1, p.x + kReach); ++x) {
      if (!pure.at<uchar>(y, x)) continue;
      const int d = (x - p.x) * (x - p.x) + (y - p.y) * (y - p.y);
      const float weight = 1.0f / static_cast<float>(d);  // p itself is never pure
      sum += weight * cv::Vec3f(image.at<cv::Vec3b>(y, x));
      total += weight;
    }
  if (!(total > 0.0f)) return std::nullopt;
  return sum * (1.0f / total);
}

// Coverage of a pixel, or nothing where the colours do not tell.
std::optional<float> coverage(const cv::Vec3f& colour, const cv::Vec3f& fore, const cv::Vec3f& back,
                              double noise) {
  // of the noise: contrast that places an edge to a sixth of a pixel
  constexpr double kClear = 6.0;
  constexpr double kOffLine = 0.35;  // of the contrast; further off no mixture explains the pixel
  const cv::Vec3f difference = fore - back, value = colour - back;
  const double squared = difference.dot(difference);
  if (squared < kClear * kClear * noise * noise) return std::nullopt;
  const double alpha = value.dot(difference) / squared;
  const cv::Vec3f off = value - difference * static_cast<float>(alpha);
  if (off.dot(off) > kOffLine * kOffLine * squared + 9.0 * noise * noise) return std::nullopt;
  return static_cast<float>(std::clamp(alpha, 0.0, 1.0));
}

}  // namespace

cv::Mat grown(const cv::Mat& mask, int px) {
  const cv::Mat square =
      cv::getStructuringElement(cv::MORPH_RECT, cv::Size(2 * px + 1, 2 * px + 1));
  cv::Mat result;
  cv::dilate(mask, result, square);
  return result;
}

cv::Mat insideOf(const cv::Mat& mask, int rim_px) {
  for (int rim = rim_px; rim > 0; rim /= 2) {
    cv::Mat core;
    cv::erode(mask, core,
              cv::getStructuringElement(cv::MORPH_RECT, cv::Size(2 * rim + 1, 2 * rim + 1)));
    if (4 * cv::countNonZero(core) > cv::countNonZero(mask)) return core;
  }
  return mask;
}

cv::Mat signedDistance(const cv::Mat& mask) {
  cv::Mat outside, inside;
  cv::distanceTransform(mask == 0, outside, cv::DIST_L2, 3);
  cv::distanceTransform(mask, inside, cv::DIST_L2, 3);
  return outside - inside;
}

cv::Mat settleEdge(const cv::Mat& image, const KnownBackground& background, double noise,
                   cv::Mat& mask) {
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, cv::Size(3, 3));
  cv::Mat inner, outer;
  cv::erode(mask, inner, square);
  cv::dilate(mask, outer, square);
  const cv::Mat edge = outer & ~inner, back_pure = ~outer;
  cv::Mat alpha = mask.clone(), settled = mask.clone();
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 0; x < mask.cols; ++x) {
      if (!edge.at<uchar>(y, x)) continue;
      const std::optional<cv::Vec3f> fore = meanNear(image, inner, {x, y});
      std::optional<cv::Vec3f> back;
      if (!background.image.empty() && background.known.at<uchar>(y, x))
        back = cv::Vec3f(background.image.at<cv::Vec3b>(y, x));
      else
        back = meanNear(image, back_pure, {x, y});
      if (!fore || !back) continue;
      const auto covered = coverage(image.at<cv::Vec3b>(y, x), *fore, *back, noise);
      if (!covered) continue;
      alpha.at<uchar>(y, x) = cv::saturate_cast<uchar>(255.0f * *covered);
      settled.at<uchar>(y, x) = *covered > 0.5f ? 255 : 0;
    }
  mask = settled;
  return alpha;
}

cv::Mat withoutStrays(const cv::Mat& mask, const cv::Mat& expected) {
  cv::Mat pieces;
  const int count = cv::connectedComponents(mask, pieces, 8, CV_32S);
  std::vector<char> met(count, 0);
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 0; x < mask.cols; ++x)
      if (expected.at<uchar>(y, x)) met[pieces.at<int>(y, x)] = 1;
  cv::Mat kept = mask.clone();
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 0; x < mask.cols; ++x)
      if (!met[pieces.at<int>(y, x)]) kept.at<uchar>(y, x) = 0;
  return 2 * cv::countNonZero(kept) > cv::countNonZero(mask) ? kept : mask;
}

}  // namespace calipso::align

#include "calipso_align/overlay.hpp"

#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace calipso::align {
namespace {

constexpr int kSubPixelBits = 4;

cv::Scalar colourOf(int label) {
  static const std::array<cv::Scalar, 6> kPalette = {
      cv::Scalar(80, 220, 60),  cv::Scalar(240, 140, 40), cv::Scalar(60, 120, 250),
      cv::Scalar(220, 80, 220), cv::Scalar(220, 220, 40), cv::Scalar(60, 220, 240)};
  return kPalette[(label - 1) % kPalette.size()];
}

cv::Point fixedPoint(const Eigen::Vector2d& p) {
  return {static_cast<int>(std::lround(p.x() * (1 << kSubPixelBits))),
          static_cast<int>(std::lround(p.y() * (1 << kSubPixelBits)))};
}

void drawLoop(const ContourLoop& loop, const cv::Scalar& colour, cv::Mat& picture) {
  for (size_t i = 0; i < loop.points.size(); ++i) {
    const size_t next = (i + 1) % loop.points.size();
    cv::line(picture, fixedPoint(loop.points[i]), fixedPoint(loop.points[next]),
             loop.known[i] ? colour : colour * 0.3, 1, cv::LINE_AA, kSubPixelBits);
  }
}

}  // namespace

cv::Mat drawOverlay(const cv::Mat& image, const cv::Mat& labels,
                    const std::vector<ObjectContour>& contours) {
  constexpr double kTint = 0.3;
  cv::Mat picture = image.clone();
  for (const ObjectContour& contour : contours) {
    cv::Mat tinted;
    cv::addWeighted(image, 1.0 - kTint, cv::Mat(image.size(), CV_8UC3, colourOf(contour.label)),
                    kTint, 0.0, tinted);
    tinted.copyTo(picture, labels == contour.label);
  }
  for (const ObjectContour& contour : contours)
    for (const ContourLoop& loop : contour.loops) drawLoop(loop, colourOf(contour.label), picture);
  return picture;
}

}  // namespace calipso::align

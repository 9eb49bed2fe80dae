#include "standing_before.hpp"

#include <opencv2/imgproc.hpp>

#include "layer_appearance.hpp"

namespace calipso::align {
namespace {

constexpr double kStillNoise = 4.0;              // grey levels; more differs where a camera moves
constexpr double kSame = 2.5, kDifferent = 6.0;  // deviations of a pixel's colour
constexpr int kPiece = 5;                        // px
constexpr float kDeep = 3.0f;                    // px inside the outline, to which that is known
constexpr int kReach = 8;                        // px that it goes on from there

// CV_8U: 255 where two pictures differ by less than so many deviations.
cv::Mat within(const cv::Mat& a, const cv::Mat& b, double deviations, double noise) {
  const float most = static_cast<float>(3.0 * deviations * deviations * noise * noise);
  cv::Mat close(a.size(), CV_8U);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < a.rows; ++y)
    for (int x = 0; x < a.cols; ++x) {
      const cv::Vec3f d = cv::Vec3f(a.at<cv::Vec3b>(y, x)) - cv::Vec3f(b.at<cv::Vec3b>(y, x));
      close.at<uchar>(y, x) = d.dot(d) < most ? 255 : 0;
    }
  return close;
}

}  // namespace

cv::Mat asBefore(const cv::Mat& image, const KnownBackground& background, const cv::Mat& clear,
                 const cv::Rect& part) {
  const double noise = noiseOf(image, background.image, background.known & clear);
  if (noise > kStillNoise) return {};
  cv::Mat as_before = cv::Mat::zeros(image.size(), CV_8U);
  cv::Mat same = within(image(part), background.image(part), kSame, noise) & background.known(part);
  // Single pixels that differ are noise.
  cv::morphologyEx(same, same, cv::MORPH_CLOSE, cv::Mat::ones(3, 3, CV_8U));
  cv::morphologyEx(same, same, cv::MORPH_OPEN, cv::Mat::ones(kPiece, kPiece, CV_8U));
  same.copyTo(as_before(part));
  return as_before;
}

cv::Mat standingBefore(const ExpectedObject& object, const KnownBackground& background,
                       const cv::Mat& as_before, double noise) {
  const cv::Mat alike = within(object.look, background.image, kDifferent, noise) & object.shown;
  cv::Mat deep = as_before & ~alike & (object.distance < -kDeep);
  cv::morphologyEx(deep, deep, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
  if (cv::countNonZero(deep) == 0) return deep;
  return as_before & grown(deep, kReach) & (object.distance < kDeep);
}

}  // namespace calipso::align

#include "calipso_flow/patch_match.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace calipso::flow {
namespace {

// A smooth picture, moved by (dx, dy), with gain, offset and a ramp of brightness.
cv::Mat picture(double dx, double dy, double gain, double offset, double ramp) {
  cv::Mat image(80, 80, CV_32F);
  for (int y = 0; y < 80; ++y) {
    for (int x = 0; x < 80; ++x) {
      const double u = x - dx, v = y - dy;
      const double grey =
          100 + 40 * std::sin(0.4 * u) * std::cos(0.3 * v) + 20 * std::sin(0.25 * v);
      image.at<float>(y, x) = static_cast<float>(gain * grey + offset + ramp * x);
    }
  }
  return image;
}

PatchSource sourceAt(const cv::Mat& image, const Eigen::Vector2d& at) {
  const cv::Mat everywhere(image.size(), CV_32F, cv::Scalar(1));
  return {{image, {}}, at, {everywhere, {}}, at};
}

TEST(PatchMatch, findsSubPixelMotion) {
  const Eigen::Vector2d at(40.0, 38.0), moved(1.37, -0.82);
  const auto match = matchPatch(sourceAt(picture(0, 0, 1, 0, 0), at),
                                {picture(moved.x(), moved.y(), 1, 0, 0), {}}, at, {});
  ASSERT_TRUE(match);
  // Bilinear interpolation of a sine of 16 px is off by up to 2 % of its slope.
  EXPECT_LT((match->position - at - moved).norm(), 0.03);
  EXPECT_GT(match->correlation, 0.99);
}

TEST(PatchMatch, takesNoShadingForMotion) {
  const Eigen::Vector2d at(40.0, 38.0), moved(0.6, 0.4);
  const auto match = matchPatch(sourceAt(picture(0, 0, 1, 0, 0), at),
                                {picture(moved.x(), moved.y(), 0.7, 25, 1.5), {}}, at, {});
  ASSERT_TRUE(match);
  EXPECT_LT((match->position - at - moved).norm(), 0.03);
}

TEST(PatchMatch, keepsPictureCoordinatesOfWindows) {
  const cv::Mat image = picture(0, 0, 1, 0, 0);
  const cv::Rect part(20, 16, 50, 50);
  const Eigen::Vector2d at(42.0, 40.0);
  const ImageWindow window{image(part), {20.0, 16.0}};
  const auto match = matchPatch(sourceAt(image, at), window, at, {});
  ASSERT_TRUE(match);
  EXPECT_LT((match->position - at).norm(), 1e-3);
}

TEST(PatchMatch, givesNothingWithoutTexture) {
  const cv::Mat flat(80, 80, CV_32F, cv::Scalar(90));
  EXPECT_FALSE(matchPatch(sourceAt(flat, {40, 40}), {flat, {}}, {40, 40}, {}));
}

TEST(PatchMatch, refusesARadiusItHasNoRoomFor) {
  const cv::Mat image = picture(0, 0, 1, 0, 0);
  PatchParams params;
  for (const int radius : {0, kMostRadius + 1}) {
    params.radius_px = radius;
    EXPECT_THROW(matchPatch(sourceAt(image, {40, 40}), {image, {}}, {40, 40}, params),
                 std::invalid_argument);
  }
}

TEST(PatchMatch, givesNothingForAnEdge) {
  // All gradients point the same way: the position along the edge is unknown.
  cv::Mat edge(80, 80, CV_32F, cv::Scalar(50));
  edge.colRange(40, 80) = 150;
  EXPECT_FALSE(matchPatch(sourceAt(edge, {40, 40}), {edge, {}}, {40, 40}, {}));
}

TEST(PatchMatch, givesNothingAtTheBorderOrWithoutSupport) {
  const cv::Mat image = picture(0, 0, 1, 0, 0);
  EXPECT_FALSE(matchPatch(sourceAt(image, {3, 40}), {image, {}}, {3, 40}, {}));
  PatchSource masked = sourceAt(image, {40, 40});
  masked.weight.image = cv::Mat(image.size(), CV_32F, cv::Scalar(0));
  EXPECT_FALSE(matchPatch(masked, {image, {}}, {40, 40}, {}));
}

// The stated covariance is that of the scatter over noisy repeats.
TEST(PatchMatch, covarianceDescribesTheScatter) {
  const cv::Mat clean = picture(0, 0, 1, 0, 0);
  const Eigen::Vector2d at(40.0, 38.0);
  cv::RNG rng(7);
  double squared = 0.0, stated = 0.0;
  constexpr int kRepeats = 300;
  for (int i = 0; i < kRepeats; ++i) {
    cv::Mat grain(clean.size(), CV_32F);
    rng.fill(grain, cv::RNG::NORMAL, 0.0, 3.0);
    const auto match = matchPatch(sourceAt(clean, at), {clean + grain, {}}, at, {});
    ASSERT_TRUE(match);
    squared += (match->position - at).squaredNorm();
    stated += match->covariance.trace();
  }
  // 300 repeats of two coordinates: the ratio's deviation is 6 %; interpolation smooths the noise.
  EXPECT_NEAR(squared / stated, 1.0, 0.35);
}

}  // namespace
}  // namespace calipso::flow

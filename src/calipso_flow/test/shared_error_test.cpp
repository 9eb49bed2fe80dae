#include "../src/shared_error.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace calipso::flow {
namespace {

constexpr int kSide = 9, kRows = 100;
constexpr double kSpacing = 5.0;  // px: patches of kSide overlap

// 8 x 8 tracks, each with a shift of its own to be found, as far as six parameters go.
WhitenedTracks gridOfTracks() {
  WhitenedTracks tracks;
  for (int i = 0; i < 64; ++i) {
    tracks.pixel.emplace_back(30.0 + kSpacing * (i % 8), 30.0 + kSpacing * (i / 8));
    Eigen::Matrix<double, 2, 6> jacobian = Eigen::Matrix<double, 2, 6>::Zero();
    jacobian.leftCols<2>().setIdentity();
    tracks.jacobian.push_back(jacobian);
  }
  tracks.residual.resize(tracks.pixel.size());
  return tracks;
}

// White noise, blurred, with unit variance at a pixel.
cv::Mat blurredNoise(cv::RNG& random, double sigma) {
  cv::Mat noise(kRows, kRows, CV_64FC2), blurred;
  random.fill(noise, cv::RNG::NORMAL, 0.0, 1.0);
  if (sigma > 0.0)
    cv::GaussianBlur(noise, blurred, {}, sigma);
  else
    cv::blur(noise, blurred, {kSide, kSide});
  cv::Scalar mean, deviation;
  cv::meanStdDev(blurred, mean, deviation);
  return blurred / deviation[0];
}

// Variances of the sum of residuals, x and y together, as stated and as it is; mean of many draws.
struct Drawn {
  double alone = 0.0, together = 0.0, actual = 0.0;
};

// @param sigma  px, of the errors' likeness; 0: as patches of kSide share them
Drawn draw(double sigma, double side) {
  constexpr int kDraws = 100;
  cv::RNG random(1);
  WhitenedTracks tracks = gridOfTracks();
  Drawn mean;
  for (int n = 0; n < kDraws; ++n) {
    const cv::Mat field = blurredNoise(random, sigma);
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (size_t i = 0; i < tracks.pixel.size(); ++i) {
      const auto& value = field.at<cv::Vec2d>(tracks.pixel[i].y(), tracks.pixel[i].x());
      sum += tracks.residual[i] = {value[0], value[1]};
    }
    const SharedError error = sharedError(tracks, 1.0, side);
    mean.alone += error.alone.topLeftCorner<2, 2>().trace() / kDraws;
    mean.together += error.together.topLeftCorner<2, 2>().trace() / kDraws;
    mean.actual += sum.squaredNorm() / kDraws;
  }
  return mean;
}

TEST(SharedError, noiseOfOverlappingPatchesIsNotTakenForTheShapes) {
  const Drawn drawn = draw(0.0, kSide), ignored = draw(0.0, 0.0);
  EXPECT_GT(drawn.actual, 2.5 * 128.0);  // 128: had every track noise of its own
  EXPECT_NEAR(drawn.alone, drawn.actual, 0.25 * drawn.actual);
  EXPECT_LT(drawn.together, 0.4 * ignored.together);
}

TEST(SharedError, whatReachesFartherThanPatchesIsTheShapes) {
  const Drawn drawn = draw(7.0, kSide);
  EXPECT_GT(drawn.together, 0.5 * drawn.actual);
  EXPECT_LT(drawn.alone, 0.25 * drawn.actual);
}

}  // namespace
}  // namespace calipso::flow

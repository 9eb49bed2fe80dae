#include "calipso_flow/outline_match.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace calipso::flow {
namespace {

// Steps around a silhouette; every seventh is on something else.
std::vector<OutlineStep> steps(double all, double right, double down) {
  std::vector<OutlineStep> result;
  for (int i = 0; i < 70; ++i) {
    const double angle = 2.0 * M_PI * i / 70.0;
    OutlineStep step;
    step.outward = {std::cos(angle), std::sin(angle)};
    step.distance =
        all + right * step.outward.x() + down * step.outward.y() + (i % 7 == 0 ? 3.5 : 0.0);
    step.variance = 0.04;
    result.push_back(step);
  }
  return result;
}

TEST(OutlineBias, isFoundByDirection) {
  const OutlineBias bias(steps(-0.35, 0.2, 0.4));
  // Strangers at 3.5 px, 17 deviations, weigh under one in 300, and pull by less than a tenth of a
  // pixel.
  EXPECT_NEAR(bias.towards({1.0, 0.0}), -0.15, 0.1);
  EXPECT_NEAR(bias.towards({0.0, -1.0}), -0.75, 0.1);
}

TEST(OutlineBias, ofNoStepsIsNone) {
  EXPECT_EQ(OutlineBias(std::vector<OutlineStep>{}).towards({0.6, 0.8}), 0.0);
}

TEST(OutlineStep, saysNothingAlongTheOutline) {
  OutlineStep step;
  step.pixel = {10.0, 20.0}, step.outward = {0.6, 0.8}, step.distance = 2.0, step.variance = 0.09;
  const SurfaceMatch match = step.match(0.5);
  EXPECT_TRUE(match.pixel.isApprox(Eigen::Vector2d(10.9, 21.2)));
  EXPECT_NEAR(step.outward.dot(match.covariance * step.outward), 0.09, 1e-9);
  const Eigen::Vector2d along(-0.8, 0.6);
  EXPECT_GT(along.dot(match.covariance * along), 1e5);
}

}  // namespace
}  // namespace calipso::flow

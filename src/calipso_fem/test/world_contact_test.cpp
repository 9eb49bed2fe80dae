#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "soft_scene.hpp"
#include "world_fixtures.hpp"

// Deformable bodies in contact: short forms of the evaluator's cases.
namespace calipso::fem {
namespace {

using namespace test;

constexpr double kG = 9.81;
const Material kSoft{1e5, 0.3, 1000.0, 0.01};

TriangleMesh cube(double size, int cells, const Eigen::Vector3d& at) {
  return movedMesh(boxSurface({size, size, size}, cells), at);
}

// Largest gain of energy between two steps' lowest points, J.
struct EnergyWatch {
  double lowest = 0.0, growth = 0.0;
  explicit EnergyWatch(const SoftScene& scene) : lowest(scene.energy()) {}
  void look(const SoftScene& scene) {
    growth = std::max(growth, scene.energy() - lowest);
    lowest = std::min(lowest, scene.energy());
  }
};

TEST(Contact, ForcesOfABlockAtRestCarryItsWeight) {
  SoftScene scene;
  scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
  SoftObject& block =
      scene.addSoft(cube(0.2, 3, {0, 0, 0.1001}), {1e5, 0.3, 1000.0, 0.03}, 0.2 / 3);
  for (int k = 0; k < 60; ++k) scene.step(1.0 / 30.0);
  double sum = 0.0, depth = 0.0;
  for (const ContactPoint& c : scene.contacts().contacts()) {
    sum += c.force.z();
    depth = std::max(depth, c.depth);
  }
  EXPECT_NEAR(sum, block.body().totalMass() * kG, 1e-3 * block.body().totalMass() * kG);
  EXPECT_LT(depth, 5e-4);  // a tenth of the minimal distance
}

// No force moves what is held, so it must not keep the step from being solved.
TEST(Contact, WhatIsHeldInsideASupportIsLeftThere) {
  SoftScene scene;
  scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
  SoftObject& block = scene.addSoft(cube(0.2, 3, {0, 0, 0.095}), kSoft, 0.2 / 3);
  std::vector<int> feet;
  for (int v = 0; v < block.vertices().rows(); ++v)
    if (block.vertices()(v, 2) < 0.0) feet.push_back(v);
  block.body().fixSurfaceVertices(feet);
  block.forgetSystem();
  for (int k = 0; k < 10; ++k) {
    scene.step(1.0 / 30.0);
    ASSERT_EQ(scene.report().bodies.size(), 1u);  // taken whole
    EXPECT_TRUE(scene.report().converged);
    EXPECT_LT(scene.report().newton_iterations, 10);
  }
  EXPECT_NEAR(block.vertices().col(2).minCoeff(), -0.005, 1e-9);
}

// A residual that does not fall with every direction is no reason to end.
TEST(Contact, AStepThatMeetsNothingEndsInBalance) {
  SoftScene scene;
  SoftObject& sheet =
      scene.addSoft(boxSurface({0.8, 0.6, 0.02}, 16), {3e5, 0.4, 1000.0, 0.01}, 0.05);
  std::vector<int> held;
  for (int v = 0; v < sheet.vertices().rows(); ++v)
    if (sheet.vertices()(v, 0) < -0.37 && sheet.vertices()(v, 1) > 0.2) held.push_back(v);
  sheet.body().fixSurfaceVertices(held);
  sheet.forgetSystem();
  for (int k = 0; k < 20; ++k) {
    scene.step(1.0 / 30.0);
    ASSERT_EQ(scene.report().bodies.size(), 1u);
    EXPECT_LE(scene.report().bodies[0].residual, sheet.body().options().newton_tolerance) << k;
  }
}

TEST(Contact, TwoFallingCubesStayOnThePlaneWithoutGainOfEnergy) {
  SoftScene scene;
  scene.surface.friction = 0.1;
  scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
  scene.addSoft(cube(0.5, 3, {0, 0, 0.4}), kSoft, 0.5 / 3);
  scene.addSoft(cube(0.5, 3, {0.03, 0.02, 1.0}), kSoft, 0.5 / 3);
  const double start = scene.energy();
  EnergyWatch watch(scene);
  double lowest = 1.0;
  for (int k = 0; k < 25; ++k) {
    scene.step(1.0 / 30.0);
    watch.look(scene);
    for (const int i : {0, 1})
      lowest = std::min(lowest, scene.soft(i).vertices().col(2).minCoeff());
  }
  EXPECT_GT(lowest, -1e-3);
  EXPECT_LT(watch.growth, 1e-3 * start);
}

TEST(Contact, CollisionOfTwoBlocksKeepsMomentum) {
  SoftScene scene;
  scene.gravity.setZero();
  scene.addSoft(cube(0.2, 2, {0, 0, 0}), kSoft, 0.1, {1, 0, 0}, {0, 0.5, 0.2});
  scene.addSoft(cube(0.2, 2, {0.25, 0.05, 0.03}), kSoft, 0.1);
  const auto before = scene.momentum();
  const double e0 = scene.energy();
  int touches = 0;
  for (int k = 0; k < 40; ++k) {
    scene.step(1.0 / 120.0);
    touches += scene.report().contacts;
    EXPECT_LT(scene.energy(), (1.0 + 1e-6) * e0);
  }
  ASSERT_GT(touches, 0);
  const auto after = scene.momentum();
  EXPECT_LT((after - before).head<3>().norm(), 1e-6 * before.head<3>().norm());
  EXPECT_LT((after - before).tail<3>().norm(), 1e-4 * before.tail<3>().norm());
}

TEST(Contact, CollisionWithARigidBlockKeepsMomentum) {
  SoftScene scene;
  scene.gravity.setZero();
  scene.addSoft(cube(0.2, 2, {0, 0, 0}), kSoft, 0.1, {1, 0, 0}, {0, 0.5, 0.2});
  scene.addRigid(boxSurface({0.2, 0.2, 0.2}, 2), 1000.0,
                 Eigen::Isometry3d(Eigen::Translation3d(0.25, 0.05, 0.03)));
  const auto before = scene.momentum();
  for (int k = 0; k < 40; ++k) scene.step(1.0 / 120.0);
  EXPECT_GT(scene.rigid().linearVelocity(0).x(), 0.1);
  const auto after = scene.momentum();
  EXPECT_LT((after - before).head<3>().norm(), 1e-6 * before.head<3>().norm());
  EXPECT_LT((after - before).tail<3>().norm(), 1e-4 * before.tail<3>().norm());
}

TEST(Contact, FastBlockDoesNotPassAThinPlate) {
  SoftScene scene;
  SoftObject& block = scene.addSoft(cube(0.2, 3, {0, 0, 0.5}), kSoft, 0.2 / 3, {0, 0, -50});
  scene.addMoving(boxSurface({1, 1, 0.002}, 4),
                  [](double) { return Eigen::Isometry3d(Eigen::Translation3d(0, 0, -0.001)); });
  for (int k = 0; k < 6; ++k) {
    scene.step(1.0 / 60.0);
    ASSERT_GT(block.vertices().col(2).minCoeff(), -1e-3) << "step " << k;
  }
}

TEST(Contact, BlockSticksBelowAndSlidesAboveTheFrictionAngle) {
  for (const double factor : {0.98, 1.1}) {
    const double angle = factor * std::atan(0.5);
    const Eigen::Vector3d normal(std::sin(angle), 0, std::cos(angle));
    SoftScene scene;
    scene.surface.friction = 0.5;
    scene.addPlane(normal, 0.0);
    TriangleMesh mesh = boxSurface({0.2, 0.2, 0.1}, 2);
    mesh.vertices =
        mesh.vertices *
        Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix().transpose();
    SoftObject& block =
        scene.addSoft(movedMesh(mesh, 0.05 * normal), {1e7, 0.3, 1000.0, 0.01}, 0.1);
    const Eigen::Vector3d start = block.body().momentum().center;
    for (int k = 0; k < 60; ++k) scene.step(1.0 / 60.0);
    const double way = (block.body().momentum().center - start).norm();
    const double expected = std::max(0.0, 0.5 * kG * (std::sin(angle) - 0.5 * std::cos(angle)));
    // Backward Euler leads the parabola by a step: 1/60 of the way.
    EXPECT_NEAR(way, expected, 0.03 * expected + 1e-3) << factor;
  }
}

TEST(Contact, SqueezedToHalfAndReleasedReturns) {
  SoftScene scene;
  scene.gravity.setZero();
  SoftObject& block = scene.addSoft(cube(0.2, 3, {0, 0, 0}), {1e5, 0.3, 1000.0, 0.03}, 0.2 / 3);
  for (const double side : {1.0, -1.0})
    scene.addMoving(boxSurface({0.5, 0.5, 0.02}, 4), [side](double t) {
      const double gap = t < 0.5 ? 0.2 - 0.2 * t : 0.4;
      return Eigen::Isometry3d(Eigen::Translation3d(0, 0, side * (0.5 * gap + 0.0101)));
    });
  const auto height = [&] {
    return block.vertices().col(2).maxCoeff() - block.vertices().col(2).minCoeff();
  };
  for (int k = 0; k < 29; ++k) scene.step(1.0 / 60.0);
  EXPECT_NEAR(height(), 0.2 - 0.2 * 29.0 / 60.0, 5e-3);  // the plates part with the 30th step
  for (int k = 0; k < 121; ++k) scene.step(1.0 / 60.0);
  EXPECT_NEAR(height(), 0.2, 2e-3);
}

TEST(Contact, OverlapAtTheStartIsUndoneGently) {
  SoftScene scene;
  scene.gravity.setZero();
  SoftObject& a = scene.addSoft(cube(0.2, 3, {0, 0, 0}), kSoft, 0.2 / 3);
  SoftObject& b = scene.addSoft(cube(0.2, 3, {0.19, 0.01, 0.02}), kSoft, 0.2 / 3);
  double fastest = 0.0;
  for (int k = 0; k < 60; ++k) {
    scene.step(1.0 / 60.0);
    fastest = std::max({fastest, a.fastest(), b.fastest()});
  }
  EXPECT_LT(fastest, 0.2);  // a few times the rate of ten minimal distances a second
  double deepest = 0.0;
  for (int v = 0; v < a.vertices().rows(); ++v)
    if (const auto hit = b.tree().nearest(a.vertices().row(v).transpose(), 0.1))
      deepest = std::max(deepest, -hit->distance);
  EXPECT_LT(deepest, 2e-3);
}

// E I / L^2 of the light one carries three times the load that lies on it.
TEST(Contact, HeavyOnLightStandsAndConverges) {
  SoftScene scene;
  scene.surface.friction = 0.5;
  scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
  SoftObject& light = scene.addSoft(cube(0.2, 3, {0, 0, 0.101}), {1e6, 0.3, 10.0, 0.02}, 0.2 / 3);
  scene.addRigid(cube(0.2, 3, {0, 0, 0}), 1e4,
                 Eigen::Isometry3d(Eigen::Translation3d(0, 0, 0.303)));
  for (int k = 0; k < 60; ++k) scene.step(1.0 / 60.0);
  EXPECT_TRUE(scene.report().converged);
  // 785 N on 1e6 Pa and 0.04 m^2: 2 %, less at the corners.
  const double height = light.vertices().col(2).maxCoeff() - light.vertices().col(2).minCoeff();
  EXPECT_NEAR(height, 0.2 * (1.0 - 80.0 * kG / 4e4), 0.02 * 0.2);
}

// Each is solved by itself; beside another that it cannot meet it moves as if alone, to the last
// bit.
TEST(Contact, BodiesThatCannotMeetDoNotDisturbEachOther) {
  const auto run = [](bool together) {
    SoftScene scene;
    scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
    SoftObject& a = scene.addSoft(cube(0.2, 2, {0, 0, 0.11}), kSoft, 0.1);
    if (together) scene.addSoft(cube(0.2, 2, {1.0, 0, 0.3}), kSoft, 0.1);
    for (int k = 0; k < 12; ++k) scene.step(1.0 / 30.0);
    return Vec(a.body().positions());
  };
  EXPECT_EQ((run(true) - run(false)).cwiseAbs().maxCoeff(), 0.0);
}

TEST(Contact, ExcludingAPairThatNeverTouchesChangesNothing) {
  const auto run = [](bool excluded) {
    SoftScene scene;
    scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
    SoftObject& a = scene.addSoft(cube(0.2, 2, {0, 0, 0.105}), kSoft, 0.1);
    scene.addSoft(cube(0.2, 2, {0.2045, 0, 0.107}), kSoft, 0.1);  // within the minimal distance
    PairRule off;
    off.contact = false;
    if (excluded) scene.contacts().setRule(0, 1, off);
    for (int k = 0; k < 10; ++k) scene.step(1.0 / 30.0);
    return Vec(a.body().positions());
  };
  EXPECT_EQ((run(true) - run(false)).cwiseAbs().maxCoeff(), 0.0);
}

}  // namespace
}  // namespace calipso::fem

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <stdexcept>

#include "world_fixtures.hpp"

namespace calipso::fem {
namespace {

using namespace test;

// A plate, held by one end, that the video shows bending upwards for 0.2 s.
struct BendingPlate {
  WorldScene scene = sceneWith(boxSurface({1.0, 0.4, 0.1}, 10), {0, 0, 2}, false);
  TriangleMesh mesh = scene.objects[0].mesh;
  Eigen::MatrixXd bending = Eigen::MatrixXd::Zero(3 * mesh.vertexCount(), 1);
  std::unique_ptr<World> world;

  BendingPlate() {
    WorldParams params;
    params.max_nodes = 300;
    params.defaults.youngs_modulus = 1e3;  // so soft that its spring hardly brakes it meanwhile
    scene.gravity.setZero();
    scene.objects[0].attachments.push_back({"end", {-0.51, -1, 1}, {-0.49, 1, 3}});
    for (int i = 0; i < mesh.vertexCount(); ++i)
      bending(3 * i + 2, 0) = std::pow(mesh.vertex(i).x() + 0.5, 2);
    world = std::make_unique<World>(scene, params);
    EXPECT_THROW(world->addObservedModes("thing", bending.topRows(3)), std::invalid_argument);
    world->addObservedModes("thing", bending);
    for (int k = 0; k < 3; ++k) {
      ObservedMotion seen;
      seen.time = 0.1 * k;
      seen.world_from_object = scene.objects[0].world_from_object;
      seen.mode_amplitudes = Eigen::VectorXd::Constant(1, 0.02 * k);
      seen.mode_velocities = Eigen::VectorXd::Constant(1, 0.2);
      world->addObservedMotion("thing", seen);
    }
  }
};

// What an edit gives another look, or moves elsewhere, goes on deforming as it does in the video.
TEST(WorldDeforming, WhatIsNotSimulatedDeformsAsInTheVideo) {
  const BendingPlate plate;
  Edit red = editOf(EditKind::kAppearance), aside = editOf(EditKind::kTransform);
  red.color = {0.5, 0, 0};
  aside.translation = {0, 3, 0};
  plate.world->submit(red);
  plate.world->submit(aside);
  plate.world->advanceTo(0.15);
  const ObjectSnapshot state = plate.world->state().objects.at(0);
  ASSERT_EQ(state.kind, ObjectKind::kKinematic);
  for (int i = 0; i < plate.mesh.vertexCount(); ++i) {
    const Eigen::Vector3d bent(0, 0, 0.03 * plate.bending(3 * i + 2, 0)),
        expected = plate.mesh.vertex(i) + Eigen::Vector3d(0, 3, 2) + bent;
    EXPECT_NEAR((state.vertices.row(i).transpose() - expected).norm(), 0.0, 1e-9) << i;
  }
}

// Touched in the midst of it, it goes on from there, also where an edit has placed it.
class StartOfDeforming : public ::testing::TestWithParam<double> {};

TEST_P(StartOfDeforming, HasItsShapeAndVelocity) {
  const BendingPlate plate;
  const TriangleMesh& mesh = plate.mesh;
  const Eigen::MatrixXd& bending = plate.bending;
  World& world = *plate.world;
  Edit aside = editOf(EditKind::kTransform, EditMode::kAbsolute, 0.05);
  aside.translation.z() = GetParam();
  if (GetParam() != 0.0) world.submit(aside);
  Edit soft = editOf(EditKind::kObjectKind, EditMode::kAbsolute, 0.1);
  soft.object_kind = ObjectKind::kDeformable;
  world.submit(soft);
  world.advanceTo(0.0);
  for (const EditOutcome& outcome : world.advanceTo(0.1))
    EXPECT_TRUE(outcome.accepted) << outcome.message;
  const double h = 1.0 / 240.0;
  const auto at_once = world.state().objects.at(0).vertices;
  world.advanceTo(0.1 + h);
  const auto later = world.state().objects.at(0).vertices;
  for (int i = 0; i < mesh.vertexCount(); ++i) {
    const double way = at_once(i, 2) - (mesh.vertex(i).z() + 2.0 + GetParam()),
                 speed = (later(i, 2) - at_once(i, 2)) / h;
    // A node goes as its surroundings do on average, over cells of 0.1 m.
    EXPECT_NEAR(way, 0.02 * bending(3 * i + 2, 0), 2e-3) << i;
    if (mesh.vertex(i).x() > 0.4) {
      EXPECT_NEAR(speed, 0.2 * bending(3 * i + 2, 0), 0.05) << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Placed, StartOfDeforming, ::testing::Values(0.0, 0.5));

// A sheet that hangs by its upper edge, one half of which is let go: that half falls, the other
// stays where it is.
TEST(WorldDeforming, APartOfTheAttachmentsIsLetGo) {
  WorldParams params;
  params.max_nodes = 300;
  params.defaults.youngs_modulus = 3e4;
  WorldScene scene = sceneWith(boxSurface({0.6, 0.01, 0.4}, 10), {0, 0, 2}, false);
  scene.objects[0].attachments.push_back({"edge", {-1, -1, 2.19}, {1, 1, 2.21}});
  World world(scene, params);
  Edit half = editOf(EditKind::kRelease);
  half.region.kind = RegionKind::kBox;
  half.region.box_min = {0.1, -1, 1}, half.region.box_max = {1, 1, 3};
  world.submit(half);
  for (const EditOutcome& outcome : world.advanceTo(0.0))
    EXPECT_TRUE(outcome.accepted) << outcome.message;
  play(world, 0.5);
  const ObjectSnapshot state = world.state().objects.at(0);
  const TriangleMesh& mesh = scene.objects[0].mesh;
  for (int v = 0; v < mesh.vertexCount(); ++v) {
    const Eigen::Vector3d at = mesh.vertex(v);
    const double fell = at.z() + 2.0 - state.vertices(v, 2);
    if (at.z() < 0.19) continue;
    if (at.x() < 0.0) {
      EXPECT_LT(std::abs(fell), 1e-3) << v;
    } else if (at.x() > 0.29) {
      EXPECT_GT(fell, 0.05) << v;
    }
  }
}

}  // namespace
}  // namespace calipso::fem

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "world_fixtures.hpp"

// What happens between two frames.
namespace calipso::fem {
namespace {

using namespace test;

// Beside the table it is too fast for its size, and a frame is taken in parts: in each of these it
// is pulled once.
TEST(WorldStep, APullCountsOnceInEveryPartOfAStep) {
  constexpr double kForce = 0.5, kSeconds = 0.2;
  WorldScene scene = sceneWith(boxSurface({0.1, 0.1, 0.1}, 3), {0, 0, 0.4});
  scene.gravity.setZero();
  World world(scene, coarse());
  Edit thrown = editOf(EditKind::kVelocity), pull = editOf(EditKind::kPull, EditMode::kForce);
  thrown.vector = {20, 0, 0};
  pull.vector = {0, 0, kForce};
  world.submit(thrown), world.submit(pull);
  world.advanceTo(0.0);
  play(world, kSeconds);
  const double way = 0.5 * kForce / world.plan()[0].mass * kSeconds * kSeconds;
  // Backward Euler leads the parabola by a step, at most half a frame here.
  EXPECT_NEAR(centerOf(world.state()).z() - 0.4, way, 0.1 * way);
}

// Whether it comes in a fall, or is thrown just before the frame in which it arrives.
TEST(WorldStep, WhatSleepsWakesBeforeAnythingFastReachesIt) {
  constexpr double kRadius = 0.03;
  WorldScene scene = sceneWith(boxSurface({0.2, 0.2, 0.2}, 3), {0, 0, 0.1});
  scene.objects.push_back(scene.objects.front());
  scene.objects[1].name = "ball", scene.objects[1].index = 2;
  scene.objects[1].mesh = sphereSurface(kRadius, 8, 12);
  for (const bool thrown : {false, true}) {
    scene.objects[1].world_from_object.translation() =
        thrown ? Eigen::Vector3d(-0.8, 0, 0.1) : Eigen::Vector3d(0, 0, 1.2);
    World world(scene, coarse());
    Edit soft = editOf(EditKind::kObjectKind), fast = editOf(EditKind::kVelocity);
    soft.object_kind = ObjectKind::kDeformable;
    fast.object = "ball", fast.vector = {30, 0, 0};
    outcomeOf(world, soft);
    play(world, 2.0);
    ASSERT_TRUE(world.state().objects[0].sleeping);
    outcomeOf(world, thrown ? fast : letGo("ball"));
    for (int frame = 0; frame < 20; ++frame) {
      play(world, 1.0 / 30.0);
      const WorldState state = world.state();
      const auto box = state.objects[0].vertices;
      const Eigen::Vector3d ball = centerOf(state, 1);
      // 5 mm, by which a blow may dent the box
      const double gap =
          thrown ? box.col(0).minCoeff() - ball.x() : ball.z() - box.col(2).maxCoeff();
      EXPECT_GT(gap, kRadius - 0.005) << "thrown: " << thrown << ", frame " << frame;
    }
    EXPECT_FALSE(world.state().objects[0].sleeping);
  }
}

// A deformable box on the table and something beside or on it; and a dart that, thrown, is so fast
// for its size that every frame is taken in parts.
WorldScene boxAnd(const TriangleMesh& mesh, const Eigen::Vector3d& at) {
  WorldScene scene = sceneWith(boxSurface({0.2, 0.2, 0.2}, 3), {0, 0, 0.1});
  scene.objects.resize(3, scene.objects.front());
  scene.objects[1].name = "other", scene.objects[1].index = 2;
  scene.objects[1].mesh = mesh;
  scene.objects[1].world_from_object.translation() = at;
  scene.objects[2].name = "dart", scene.objects[2].index = 3;
  scene.objects[2].mesh = boxSurface({0.05, 0.05, 0.05}, 1);
  scene.objects[2].world_from_object.translation() = Eigen::Vector3d(-10, 5, 0.1);
  return scene;
}

Edit madeDeformable(const std::string& object) {
  Edit edit = editOf(EditKind::kObjectKind);
  edit.object = object, edit.object_kind = ObjectKind::kDeformable;
  return edit;
}

Edit thrown(const std::string& object, double speed) {
  Edit edit = editOf(EditKind::kVelocity);
  edit.object = object, edit.vector = {speed, 0, 0};
  return edit;
}

TEST(WorldStep, WhatIsRigidTakesPartInEveryPartOfAStep) {
  constexpr double kRadius = 0.03;
  for (const double speed : {3.0, 20.0}) {
    World world(boxAnd(sphereSurface(kRadius, 8, 12), {-0.5, 0, 0.1}), coarse());
    for (const Edit& edit : {madeDeformable("thing"), thrown("other", speed),
                             madeDeformable("dart"), thrown("dart", 20.0)})
      ASSERT_TRUE(outcomeOf(world, edit).accepted);
    double deepest = 0.0;
    for (int frame = 0; frame < 10; ++frame) {
      play(world, 1.0 / 30.0);
      const WorldState state = world.state();
      deepest = std::max(
          deepest, centerOf(state, 1).x() + kRadius - state.objects[0].vertices.col(0).minCoeff());
    }
    EXPECT_LT(deepest, 0.002) << speed;
    EXPECT_GT(deepest, -0.002) << speed << ": they have not met";
  }
}

TEST(WorldStep, WhatRestsOnADeformableObjectIsCarriedInEveryPartOfAStep) {
  World world(boxAnd(boxSurface({0.1, 0.1, 0.1}, 1), {0, 0, 0.25}), coarse());
  Edit rigid = madeDeformable("other");
  rigid.object_kind = ObjectKind::kRigid;
  for (const Edit& edit :
       {madeDeformable("thing"), rigid, madeDeformable("dart"), thrown("dart", 20.0)})
    ASSERT_TRUE(outcomeOf(world, edit).accepted);
  play(world, 0.2);
  EXPECT_NEAR(centerOf(world.state(), 1).z(), 0.25, 1e-3);
}

}  // namespace
}  // namespace calipso::fem

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "calipso_fem/world/surface_tree.hpp"
#include "world_fixtures.hpp"

// Objects of the video that an edited one runs into.
namespace calipso::fem {
namespace {

using namespace test;

constexpr double kRadius = 0.05, kFrame = 1.0 / 30.0;

// Two balls in free space, 0.3 m apart along x.
WorldScene twoBalls() {
  WorldScene scene = sceneWith(sphereSurface(kRadius, 16, 24), {0, 0, 0.5}, false);
  scene.gravity.setZero();
  scene.objects.push_back(scene.objects.front());
  scene.objects[1].name = "other", scene.objects[1].index = 2;
  scene.objects[1].world_from_object.translation().x() = 0.3;
  return scene;
}

Eigen::Vector3d placeOf(const World& world, int object) {
  return world.state().objects[object].world_from_object.translation();
}

// m/s, along x, over the next frame.
Eigen::Vector2d speedsAlongX(World& world) {
  const Eigen::Vector2d before(placeOf(world, 0).x(), placeOf(world, 1).x());
  play(world, kFrame);
  return (Eigen::Vector2d(placeOf(world, 0).x(), placeOf(world, 1).x()) - before) / kFrame;
}

Edit throwOf(const std::string& object, double speed) {
  Edit edit = editOf(EditKind::kVelocity);
  edit.object = object;
  edit.vector = {speed, 0, 0};
  return edit;
}

// Equal masses along the line of their centres: the momentum is shared out and none is lost.
TEST(WorldStrikes, WhatAThrownBallHitsTakesUpItsMomentum) {
  World world(twoBalls(), {});
  world.submit(throwOf("thing", 1.0));
  world.advanceTo(0.0);
  play(world, 0.1);
  EXPECT_EQ(world.state().objects[1].kind, ObjectKind::kStatic) << "struck before anything came";
  play(world, 0.4);
  EXPECT_EQ(world.state().objects[1].kind, ObjectKind::kRigid);
  EXPECT_NE(world.plan()[1].reason.find("thing strikes it"), std::string::npos);
  const Eigen::Vector2d speeds = speedsAlongX(world);
  EXPECT_GT(speeds[1], 0.4);
  // 1e-2: the spheres are polyhedra, which meet a little beside their centres
  EXPECT_NEAR(speeds.sum(), 1.0, 1e-2);
}

TEST(WorldStrikes, WhatPassesByLeavesItInPeace) {
  WorldScene scene = twoBalls();
  scene.objects[1].world_from_object.translation().y() = 0.12;
  World world(scene, {});
  world.submit(throwOf("thing", 1.0));
  world.advanceTo(0.0);
  play(world, 0.6);
  EXPECT_EQ(world.state().objects[1].kind, ObjectKind::kStatic);
  EXPECT_NEAR(placeOf(world, 0).x(), 0.6, 1e-6);
}

// What a user holds in place, by a parameter, an edit, infinite mass or attachments, is a wall.
TEST(WorldStrikes, WhatIsHeldStaysAndTheBallComesBack) {
  for (const char* const by : {"kind", "edit", "density", "attachment"}) {
    WorldScene scene = twoBalls();
    WorldParams params;
    ObjectSettings& other = params.objects["other"];
    if (by == std::string("kind")) other.kind = ObjectKind::kStatic;
    if (by == std::string("density")) other.density = std::numeric_limits<double>::infinity();
    if (by == std::string("attachment"))
      scene.objects[1].attachments.push_back({"hook", {0.29, -0.1, 0.4}, {0.4, 0.1, 0.6}});
    World world(scene, params);
    Edit hold = editOf(EditKind::kObjectKind);
    hold.object = "other", hold.object_kind = ObjectKind::kStatic;
    if (by == std::string("edit")) world.submit(hold);
    world.submit(throwOf("thing", 1.0));
    world.advanceTo(0.0);
    play(world, 0.6);
    EXPECT_NEAR((placeOf(world, 1) - Eigen::Vector3d(0.3, 0, 0.5)).norm(), 0.0, 1e-9) << by;
    EXPECT_LT(placeOf(world, 0).x(), 0.3 - 2.0 * kRadius + 1e-3) << by;
  }
}

// On a table, a nudge that friction stops within a hundredth of its size is none.
TEST(WorldStrikes, ANudgeMovesNothing) {
  for (const double speed : {0.05, 1.5}) {
    WorldScene scene = sceneWith(boxSurface({0.1, 0.1, 0.1}, 1), {0, 0, 0.05});
    scene.objects.push_back(scene.objects.front());
    scene.objects[1].name = "other", scene.objects[1].index = 2;
    scene.objects[1].world_from_object.translation().x() = 0.1005;
    World world(scene, {});
    world.submit(throwOf("thing", speed));
    world.advanceTo(0.0);
    play(world, 0.5);
    EXPECT_EQ(world.state().objects[1].kind == ObjectKind::kRigid, speed > 1.0) << speed;
    EXPECT_EQ(placeOf(world, 1).x() > 0.102, speed > 1.0) << speed;
  }
}

// Largest depth of one surface's vertices in the other, m.
double depthIn(const TriangleMesh& mesh, const ObjectSnapshot& at, const ObjectSnapshot& other) {
  TriangleMesh surface = mesh;
  surface.vertices = other.vertices;
  const SurfaceTree tree(surface);
  double depth = 0.0;
  for (const auto& vertex : at.vertices.rowwise())
    if (const auto hit = tree.nearest(vertex.transpose(), 0.02))
      depth = std::max(depth, -hit->distance);
  return depth;
}

// What lies on a table cannot give way to a soft body that falls on it; it rolls aside. The table's
// push belongs to the blow: without it the one below would be thrown back up into the soft one.
TEST(WorldStrikes, ARigidBodyOnATableHoldsASoftOneOut) {
  const TriangleMesh rod = bentRod(0.2, 0.04);
  WorldScene scene = sceneWith(rod, {0, 0, 0.02});
  scene.objects.push_back(scene.objects.front());
  scene.objects[1].name = "other", scene.objects[1].index = 2;
  scene.objects[0].world_from_object.translation() = Eigen::Vector3d(0.01, 0.0, 0.14);
  scene.objects[0].world_from_object.rotate(
      Eigen::AngleAxisd(0.5 * M_PI, Eigen::Vector3d::UnitZ()));
  World world(scene, {});
  Edit soft = editOf(EditKind::kMaterial, EditMode::kFactor);
  soft.object = "thing";
  soft.youngs_modulus = 0.03;
  world.submit(soft);
  world.submit(letGo("thing"));
  world.advanceTo(0.0);
  double depth = 0.0, highest = 0.0;
  for (int frame = 0; frame < 20; ++frame) {
    play(world, kFrame);
    const WorldState state = world.state();
    if (state.objects[1].vertices.rows() == 0) continue;
    depth = std::max(depth, depthIn(rod, state.objects[0], state.objects[1]));
    highest = std::max(highest, state.objects[1].world_from_object.translation().z());
  }
  EXPECT_EQ(world.state().objects[1].kind, ObjectKind::kRigid);
  EXPECT_LT(depth, 1e-3);
  EXPECT_LT(highest, 0.025);
}

// In the video the other ball comes along and would go through what stands in its way now.
TEST(WorldStrikes, WhatTheVideoMovesBouncesOffWhatIsPutInItsWay) {
  World world(twoBalls(), {});
  for (int k = 0; k <= 30; ++k) {
    ObservedMotion m;
    m.time = k * kFrame;
    m.moving = true;
    m.linear = {-1.0, 0, 0};
    m.world_from_object.translation() = m.centroid = Eigen::Vector3d(0.3 - m.time, 0, 0.5);
    world.addObservedMotion("other", m);
  }
  Edit heavy = editOf(EditKind::kMaterial, EditMode::kFactor);
  heavy.object = "thing";
  heavy.density = 100.0;
  world.submit(heavy);
  world.advanceTo(0.0);
  play(world, 0.1);
  EXPECT_NEAR(placeOf(world, 1).x(), 0.2, 1e-6) << "as in the video before they meet";
  play(world, 0.7);
  EXPECT_GE(placeOf(world, 1).x(), 0.09);
  EXPECT_GT(speedsAlongX(world)[1], -0.1);
}

// In the video one ball hits the other, which goes on in its place. Without the first one, or when
// that goes elsewhere, the other stays; a third one that collides at the same time far away has no
// part in it.
TEST(WorldStrikes, WhatNothingStrikesAnyMoreStays) {
  constexpr double kHit = 6.0 * kFrame;
  for (const std::string edited : {"thing", "far", ""}) {
    WorldScene scene = twoBalls();
    scene.objects.push_back(scene.objects.front());
    scene.objects[2].name = "far", scene.objects[2].index = 3;
    scene.objects[2].world_from_object.translation().y() = 2.0;
    World world(scene, {});
    for (int k = 0; k <= 30; ++k) {
      ObservedMotion m;
      m.time = k * kFrame;
      m.moving = true;
      m.linear.x() = m.time < kHit ? 1.0 : 0.0;
      m.world_from_object.translation() = m.centroid =
          Eigen::Vector3d(std::min(m.time, kHit), 0, 0.5);
      world.addObservedMotion("thing", m);
      m.linear.x() = m.time < kHit ? 0.0 : 1.0;
      m.world_from_object.translation() = m.centroid =
          Eigen::Vector3d(0.3 + std::max(0.0, m.time - kHit), 0, 0.5);
      world.addObservedMotion("other", m);
    }
    for (const char* const ball : {"thing", "other", "far"}) world.addCollision(ball, kHit);
    Edit edit = editOf(EditKind::kRemove);
    edit.object = edited;
    if (!edited.empty()) world.submit(edit);
    world.advanceTo(0.0);
    play(world, 0.8);
    const bool stays = edited == "thing";
    EXPECT_NEAR(placeOf(world, 1).x(), stays ? 0.3 : 0.9, 1e-6) << edited;
  }
}

}  // namespace
}  // namespace calipso::fem

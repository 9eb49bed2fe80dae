#include <gtest/gtest.h>

#include <functional>

#include "calipso_fem/world/mass_properties.hpp"
#include "calipso_fem/world/wind.hpp"
#include "world_fixtures.hpp"

namespace calipso::fem {
namespace {

using namespace test;

World boxInTheAir() {
  WorldScene scene = sceneWith(boxSurface({0.1, 0.1, 0.1}, 3), {0, 0, 0.5}, false);
  scene.gravity.setZero();
  return World(scene, coarse());
}

Edit rigidKind() {
  Edit edit = editOf(EditKind::kObjectKind);
  edit.object_kind = ObjectKind::kRigid;
  return edit;
}

TriangleMesh plate(double side) {  // in the plane x = 0
  TriangleMesh mesh;
  mesh.vertices.resize(4, 3);
  mesh.vertices << 0, 0, 0, 0, side, 0, 0, side, side, 0, 0, side;
  mesh.triangles.resize(2, 3);
  mesh.triangles << 0, 1, 2, 0, 2, 3;
  return mesh;
}

TEST(Wind, PressesOnAPlateByTheSquareOfTheSpeedAcrossIt) {
  const TriangleMesh mesh = plate(2.0);
  const Vertices still = Vertices::Zero(4, 3);
  const Air air{{3.0, 4.0, 0.0}, 1.2};
  const Eigen::Vector3d force =
      windForces(mesh.vertices, still, mesh.triangles, air, 1.0, 0.0).colwise().sum().transpose();
  EXPECT_NEAR(force.x(), 0.5 * 1.2 * 9.0 * 4.0,
              1e-12);  // p A, the speed along the plate does not count
  EXPECT_NEAR(force.tail<2>().norm(), 0.0, 1e-12);
}

TEST(Wind, DoesNothingToASheetThatMovesWithIt) {
  const TriangleMesh mesh = plate(1.0);
  Vertices with(4, 3);
  with.rowwise() = Eigen::RowVector3d(3, 4, 0);
  EXPECT_EQ(windForces(mesh.vertices, with, mesh.triangles, {{3, 4, 0}, 1.2}, 1.0, 0.0).norm(),
            0.0);
}

TEST(Wind, AClosedSheetCountsOnce) {
  const TriangleMesh thin = boxSurface({1e-6, 2.0, 2.0}, 2);
  const Vertices still = Vertices::Zero(thin.vertices.rows(), 3);
  const Eigen::Vector3d force =
      windForces(thin.vertices, still, thin.triangles, {{3, 0, 0}, 0.5 * 1.2}, 1.0, 0.0)
          .colwise()
          .sum()
          .transpose();
  EXPECT_NEAR(force.x(), 0.5 * 1.2 * 9.0 * 4.0, 1e-9);
}

TEST(WorldLoads, WindTakesABodyAlongAndNotBeyond) {
  for (const bool rigid : {true, false})
    for (const double lighter_from : {0.0, 0.1}) {
      World world = boxInTheAir();
      if (rigid) world.submit(rigidKind());
      Edit wind = editOf(EditKind::kWind),
           light = editOf(EditKind::kMaterial, EditMode::kAbsolute, lighter_from);
      wind.vector = {4, 0, 0};
      light.density = 0.1;
      world.submit(wind), world.submit(light);
      world.advanceTo(0.0);
      double before = centerOf(world.state()).x(), fastest = 0.0;
      for (int k = 1; k <= 60; ++k) {
        world.advanceTo(k / 30.0);
        const double x = centerOf(world.state()).x();
        fastest = std::max(fastest, 30.0 * (x - before));
        before = x;
      }
      EXPECT_GT(fastest, 2.0) << rigid << ", " << lighter_from;
      EXPECT_LE(fastest, 4.0 + 1e-9) << rigid << ", " << lighter_from;
    }
}

TEST(WorldLoads, ATorqueTurnsARigidBodyByItsInertia) {
  World world = boxInTheAir();
  world.submit(rigidKind());
  Edit twist = editOf(EditKind::kTwist, EditMode::kForce);
  const double torque = 1e-3;
  twist.vector = {0, 0, torque};
  world.submit(twist);
  world.advanceTo(0.0);
  play(world, 0.5);
  const auto plan = world.plan();
  const double inertia = plan[0].mass * 0.1 * 0.1 / 6.0;  // of a cube about its centre
  const Eigen::AngleAxisd turned(world.state().objects[0].world_from_object.linear());
  // T t^2 / (2 I); Bullet's steps lead the parabola by at most one of them.
  EXPECT_NEAR(turned.angle(), 0.5 * torque / inertia * 0.25, 0.05 * 0.5 * torque / inertia * 0.25);
}

TEST(WorldLoads, ATwistToATargetTurnsTheRegionOfADeformableObject) {
  World world = boxInTheAir();
  Edit hold = editOf(EditKind::kFix);
  hold.region.kind = RegionKind::kBox;
  hold.region.box_min = {-1, -1, 0.44};
  hold.region.box_max = {1, 1, 0.455};
  world.submit(hold);
  Edit twist = editOf(EditKind::kTwist, EditMode::kTarget);
  twist.region.kind = RegionKind::kBox;
  twist.region.box_min = {-1, -1, 0.545};
  twist.region.box_max = {1, 1, 0.56};
  twist.vector = {0, 0, 0.4};
  twist.ramp = 0.2;
  world.submit(twist);
  for (const EditOutcome& outcome : world.advanceTo(0.0))
    EXPECT_TRUE(outcome.accepted) << outcome.message;
  const auto start = boxSurface({0.1, 0.1, 0.1}, 3).vertices;
  play(world, 1.0);
  const auto now = world.state().objects[0].vertices;
  int seen = 0;
  for (Eigen::Index v = 0; v < start.rows(); ++v) {
    if (start(v, 2) < 0.0499 || start.row(v).head<2>().norm() < 1e-6) continue;
    const double before = std::atan2(start(v, 1), start(v, 0)),
                 after = std::atan2(now(v, 1), now(v, 0));
    EXPECT_NEAR(std::remainder(after - before, 2.0 * M_PI), 0.4, 0.02);  // of the embedding
    ++seen;
  }
  EXPECT_GE(seen, 12);
}

// At half the pace the same way takes twice as long: a thrown body is where it would be after half
// the time.
TEST(WorldLoads, SlowDynamicsRunTheSameWaySlower) {
  const auto wayAfter = [](double seconds, double pace) {
    World world = boxInTheAir();
    world.submit(rigidKind());
    Edit speed = editOf(EditKind::kSpeedScale);
    speed.object.clear();
    speed.factor = pace;
    world.submit(speed);
    Edit gravity = editOf(EditKind::kGravity);
    gravity.vector = {0, 0, -9.81};
    world.submit(gravity);
    world.advanceTo(0.0);
    const Eigen::Vector3d start = centerOf(world.state());
    play(world, seconds);
    return Eigen::Vector3d(centerOf(world.state()) - start);
  };
  const Eigen::Vector3d fast = wayAfter(0.5, 1.0), slow = wayAfter(1.0, 0.5);
  EXPECT_NEAR(fast.z(), -0.5 * 9.81 * 0.25, 1e-6);
  EXPECT_NEAR((fast - slow).norm(), 0.0, 1e-6);
}

TEST(WorldLoads, AnEditWaitsForACollisionInTheVideo) {
  World world = boxInTheAir();
  Edit edit = editOf(EditKind::kTransform, EditMode::kAbsolute, 0.1);
  edit.translation = {0, 0, 1};
  edit.after = "thing";
  edit.collision = 2;
  world.submit(edit);
  world.addCollision("thing", 0.2);
  world.addCollision("thing", 0.3);
  world.advanceTo(0.0);
  play(world, 0.3);
  EXPECT_FALSE(world.state().objects[0].edited);
  world.advanceTo(0.45);
  EXPECT_TRUE(world.state().objects[0].edited);
}

TEST(WorldLoads, ACollisionThatIsNotInTheVideoIsRefused) {
  World world = boxInTheAir();
  Edit edit = editOf(EditKind::kRemove);
  edit.after = "thing";
  world.submit(edit);
  EXPECT_TRUE(world.advanceTo(0.0).empty());
  world.allCollisionsKnown();
  const auto outcomes = world.advanceTo(0.1);
  ASSERT_EQ(outcomes.size(), 1u);
  EXPECT_FALSE(outcomes[0].accepted);
  EXPECT_NE(outcomes[0].message.find("collision 1 of thing"), std::string::npos);
}

TEST(WorldLoads, WhatTheVideoShowsOfGravityCanBeTaken) {
  Edit edit = editOf(EditKind::kGravity, EditMode::kEstimated);
  edit.object.clear();
  World blind(sceneWith(boxSurface({0.1, 0.1, 0.1}, 2), {0, 0, 5}, false), coarse());
  blind.submit(edit);
  const auto refused = blind.advanceTo(0.0);
  EXPECT_FALSE(refused.at(0).accepted);
  EXPECT_NE(refused[0].message.find("seen to fall"), std::string::npos);

  World world(sceneWith(boxSurface({0.1, 0.1, 0.1}, 2), {0, 0, 5}, false), coarse());
  world.addObservedGravity({0, 0, -6.0}, 0.1);
  world.addObservedGravity({0, 0, -5.0}, 0.5);  // less sure
  world.submit(rigidKind());
  world.submit(edit);
  for (const EditOutcome& outcome : world.advanceTo(0.0))
    EXPECT_TRUE(outcome.accepted) << outcome.message;
  play(world, 0.5);
  // Afloat: buoyancy holds the weight under the scene's 9.81 m/s^2. 0.04: of the time step.
  EXPECT_NEAR(centerOf(world.state()).z(), 5.0 + 0.5 * (9.81 - 6.0) * 0.25, 0.04);
}

TEST(WorldLoads, TheWindOfTheVideoCanBeTaken) {
  Edit edit = editOf(EditKind::kWind, EditMode::kEstimated);
  World blind = boxInTheAir();
  blind.submit(edit);
  const auto refused = blind.advanceTo(0.0);
  EXPECT_FALSE(refused.at(0).accepted);
  EXPECT_NE(refused[0].message.find("mode absolute"), std::string::npos) << refused[0].message;

  // Taken, it does what the same wind given by hand does; doubled, more.
  const auto drift = [&](const std::function<void(World&, Edit&)>& choose) {
    World world = boxInTheAir();
    Edit chosen = edit;
    choose(world, chosen);
    world.submit(rigidKind());
    world.submit(chosen);
    for (const EditOutcome& outcome : world.advanceTo(0.0))
      EXPECT_TRUE(outcome.accepted) << outcome.message;
    const Eigen::Vector3d start = centerOf(world.state());
    play(world, 0.5);
    return Eigen::Vector3d(centerOf(world.state()) - start);
  };
  const Eigen::Vector3d velocity(9.0, 0.0, 0.0);
  const auto show = [&](World& world, const Eigen::Vector3d& late) {
    world.addObservedWind("thing", {1.0, late, Eigen::Matrix3d::Identity()});
    world.addObservedWind("thing", {0.0, velocity, Eigen::Matrix3d::Identity()});
  };
  const Eigen::Vector3d given =
      drift([&](World&, Edit& e) { e.mode = EditMode::kAbsolute, e.vector = velocity; });
  const Eigen::Vector3d taken = drift([&](World& w, Edit&) { show(w, velocity); });
  const Eigen::Vector3d doubled =
      drift([&](World& w, Edit& e) { show(w, velocity), e.factor = 2.0; });
  const Eigen::Vector3d dying = drift([&](World& w, Edit&) { show(w, -velocity); });
  EXPECT_EQ(taken, given);
  EXPECT_NEAR(doubled.x(), 4.0 * taken.x(),
              0.1 * taken.x());  // drag is quadratic; less what it drifts with the air
  EXPECT_GT(dying.x(), 0.0);
  EXPECT_LT(dying.x(), 0.8 * taken.x());
}

TEST(WindTrack, IsLinearBetweenItsSamplesAndHoldsOutside) {
  WindTrack track;
  track.add({1.0, {2.0, 0.0, 0.0}, Eigen::Matrix3d::Identity()});
  track.add({0.0, {0.0, 4.0, 0.0}, 3.0 * Eigen::Matrix3d::Identity()});
  EXPECT_EQ(track.at(-1.0), Eigen::Vector3d(0.0, 4.0, 0.0));
  EXPECT_EQ(track.at(0.25), Eigen::Vector3d(0.5, 3.0, 0.0));
  EXPECT_EQ(track.at(2.0), Eigen::Vector3d(2.0, 0.0, 0.0));
  EXPECT_EQ(track.variance(), 2.0);
  EXPECT_EQ(track.times(-2.0).at(1.0), Eigen::Vector3d(-4.0, 0.0, 0.0));
  EXPECT_EQ(track.times(-2.0).variance(), 8.0);
}

TEST(WorldLoads, ACopyLivesOnItsOwn) {
  World world(sceneWith(boxSurface({0.1, 0.1, 0.1}, 2), {0, 0, 0.05}), coarse());
  Edit twin = editOf(EditKind::kDuplicate);
  twin.new_name = "twin";
  twin.translation = {0.3, 0, 0.2};
  world.submit(twin);
  for (const EditOutcome& outcome : world.advanceTo(0.0))
    EXPECT_TRUE(outcome.accepted) << outcome.message;
  WorldState state = world.state();
  ASSERT_EQ(state.objects.size(), 2u);
  EXPECT_EQ(state.objects[1].source, "thing");
  EXPECT_NEAR((centerOf(state, 1) - Eigen::Vector3d(0.3, 0, 0.25)).norm(), 0.0, 1e-9);
  play(world, 1.5);
  state = world.state();
  EXPECT_FALSE(state.objects[0].edited);
  EXPECT_NEAR(centerOf(state, 1).z(), 0.05, 2e-3);  // it lies on the table, up to the resting gap
  Edit again = editOf(EditKind::kDuplicate);
  again.new_name = "twin";
  world.submit(again);
  EXPECT_FALSE(world.advanceTo(world.time()).at(0).accepted) << "the name is taken";
}

TEST(WorldLoads, AnEditToComeNamesACopyAndHoldsIt) {
  World world(sceneWith(boxSurface({0.1, 0.1, 0.1}, 2), {0, 0, 0.05}), coarse());
  Edit twin = editOf(EditKind::kDuplicate), hold = editOf(EditKind::kObjectKind);
  twin.new_name = hold.object = "twin";
  twin.translation = {0.3, 0, 0.2};
  hold.object_kind = ObjectKind::kStatic;
  world.submit(twin);
  world.submit(hold);
  for (const EditOutcome& outcome : world.advanceTo(0.0))
    EXPECT_TRUE(outcome.accepted) << outcome.message;
  play(world, 0.5);
  EXPECT_NEAR((centerOf(world.state(), 1) - Eigen::Vector3d(0.3, 0, 0.25)).norm(), 0.0, 1e-9);
}

TEST(WorldLoads, ACopyOfClothIsCloth) {
  World world(sceneWith(boxSurface({0.4, 0.002, 0.3}, 8), {0, 0, 1}, false), coarse());
  Edit twin = editOf(EditKind::kDuplicate);
  twin.new_name = "twin";
  world.submit(twin);
  world.advanceTo(0.0);
  EXPECT_EQ(world.state().objects.at(1).kind, ObjectKind::kDeformable);
}

TEST(WorldLoads, AnInsertedModelFallsOntoTheTable) {
  WorldScene scene = sceneWith(boxSurface({0.1, 0.1, 0.1}, 2), {0, 0, 0.05});
  scene.directory = ::testing::TempDir();
  saveObj(boxSurface({1.0, 2.0, 1.0}, 2), scene.directory + "/crate.obj");
  World world(scene, coarse());
  Edit insert = editOf(EditKind::kInsert);
  insert.object.clear();
  insert.new_name = "crate";
  insert.model_path = "crate.obj";
  insert.scale = 0.05;
  insert.translation = {0.3, 0, 0.2};
  insert.density = 700.0;
  insert.color = {0.8, 0.1, 0.1};
  world.submit(insert);
  for (const EditOutcome& outcome : world.advanceTo(0.0))
    EXPECT_TRUE(outcome.accepted) << outcome.message;
  WorldState state = world.state();
  ASSERT_EQ(state.objects.size(), 2u);
  EXPECT_EQ(state.objects[1].kind, ObjectKind::kRigid);
  EXPECT_EQ(state.objects[1].triangles.rows(), boxSurface({1, 1, 1}, 2).triangles.rows());
  EXPECT_EQ(state.objects[1].look.color, insert.color);
  EXPECT_NEAR((centerOf(state, 1) - insert.translation).norm(), 0.0, 1e-9);
  for (const PlanEntry& entry : world.plan()) {
    if (entry.object != "crate") continue;
    EXPECT_NEAR(entry.mass, 700.0 * 2.0 * std::pow(0.05, 3), 1e-9);
  }
  play(world, 1.5);
  state = world.state();
  EXPECT_FALSE(state.objects[0].edited);
  EXPECT_TRUE(state.objects[0].triangles.rows() == 0);
  EXPECT_NEAR(centerOf(state, 1).z(), 0.025, 2e-3);
}

TEST(WorldLoads, AModelThatIsNotThereIsRefused) {
  World world = boxInTheAir();
  Edit insert = editOf(EditKind::kInsert);
  insert.object.clear();
  insert.new_name = "crate";
  insert.model_path = "nowhere.obj";
  world.submit(insert);
  const auto outcomes = world.advanceTo(0.0);
  ASSERT_EQ(outcomes.size(), 1u);
  EXPECT_FALSE(outcomes[0].accepted);
  EXPECT_NE(outcomes[0].message.find("nowhere.obj"), std::string::npos) << outcomes[0].message;
  EXPECT_EQ(world.state().objects.size(), 1u);
}

TEST(WorldLoads, WhatDoesNotMeetTheTableFallsThroughIt) {
  World world(sceneWith(boxSurface({0.1, 0.1, 0.1}, 2), {0, 0, 0.05}), coarse());
  Edit apart = editOf(EditKind::kContact);
  apart.other = "table";
  apart.meet = false;
  world.submit(apart);
  Edit push = editOf(EditKind::kVelocity);
  push.vector = {0, 0, 0.1};
  world.submit(push);
  for (const EditOutcome& outcome : world.advanceTo(0.0))
    EXPECT_TRUE(outcome.accepted) << outcome.message;
  play(world, 0.5);
  EXPECT_LT(centerOf(world.state()).z(), -0.5);
}

TEST(WorldLoads, ALookIsHandedOn) {
  World world = boxInTheAir();
  Edit look = editOf(EditKind::kAppearance, EditMode::kFactor);
  look.color = {1, 0.5, 0.25};
  world.submit(look);
  Edit sun = editOf(EditKind::kLight);
  sun.object.clear();
  sun.vector = {1, 0, 1};
  world.submit(sun);
  for (const EditOutcome& outcome : world.advanceTo(0.0))
    EXPECT_TRUE(outcome.accepted) << outcome.message;
  const WorldState state = world.state();
  EXPECT_TRUE(state.objects[0].edited);
  EXPECT_EQ(state.objects[0].look.color, look.color);
  EXPECT_FALSE(state.objects[0].look.absolute);
  EXPECT_EQ(state.sun.direction, sun.vector);
}

}  // namespace
}  // namespace calipso::fem

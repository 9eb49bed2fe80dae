#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "world_fixtures.hpp"

// What earlier edits have given an object outlasts later ones.
namespace calipso::fem {
namespace {

using namespace test;

WorldScene box(double height = 0.05) {
  return sceneWith(boxSurface({0.1, 0.1, 0.1}, 3), {0, 0, height});
}

// A box on the table, and another one on it or beside it.
WorldScene twoBoxes(const Eigen::Vector3d& other) {
  WorldScene scene = box();
  scene.objects.push_back(scene.objects.front());
  scene.objects[1].name = "other", scene.objects[1].index = 2;
  scene.objects[1].world_from_object.translation() = other;
  return scene;
}

Edit of(const std::string& object, Edit edit) {
  edit.object = object;
  return edit;
}

Edit kindEdit(ObjectKind kind) {
  Edit edit = editOf(EditKind::kObjectKind);
  edit.object_kind = kind;
  return edit;
}

void apply(World& world, const Edit& edit) {
  const EditOutcome outcome = outcomeOf(world, edit);
  EXPECT_TRUE(outcome.accepted) << outcome.message;
}

double lowest(const WorldState& state, int object = 0) {
  return state.objects[object].vertices.col(2).minCoeff();
}

Edit slantedGravity(const Eigen::Vector3d& vector) {
  Edit edit = editOf(EditKind::kGravity);
  edit.object.clear();
  edit.vector = vector;
  return edit;
}

TEST(WorldChanges, WhatIsHeldIsHeldWhereItWasPut) {
  World world(box(0.5), coarse());
  world.advanceTo(0.0);
  Edit fix = editOf(EditKind::kFix), move = editOf(EditKind::kTransform);
  fix.region.kind = RegionKind::kBox;
  fix.region.box_min = {-1, -1, 0.54}, fix.region.box_max = {1, 1, 1};
  move.translation = {0.2, 0, 0};
  apply(world, fix);
  apply(world, move);
  play(world, 0.1);
  EXPECT_NEAR(centerOf(world.state()).x(), 0.2, 0.01);
}

TEST(WorldChanges, APullGoesOnInAScaledBodyAndEnds) {
  World world(box(0.5), coarse());
  world.advanceTo(0.0);
  Edit pull = editOf(EditKind::kPull, EditMode::kTarget), scale = editOf(EditKind::kTransform);
  pull.region.kind = RegionKind::kBox;
  pull.region.box_min = {-1, -1, 0.54}, pull.region.box_max = {1, 1, 1};
  pull.vector = {0.1, 0, 0}, pull.ramp = 0.4, pull.duration = 0.5;
  scale.scale = 0.5;
  apply(world, pull);
  play(world, 0.2);
  const double half_way = centerOf(world.state()).x();
  apply(world, scale);
  play(world, 0.2);
  EXPECT_NEAR(centerOf(world.state()).x() - half_way, 0.05, 0.02);
  EXPECT_NO_THROW(play(world, 0.3));
  world.submit(editOf(EditKind::kRelease, EditMode::kAbsolute, world.time()));
  for (const EditOutcome& outcome : world.advanceTo(world.time()))
    EXPECT_FALSE(outcome.accepted) << "it was let go";
}

// Pressed on from all sides, a cube loses 3 p (1 - 2 nu) / E of its volume.
TEST(WorldChanges, PressureOutlastsAnotherScale) {
  constexpr double kLoss = 0.03;
  TriangleMesh cube = boxSurface({0.1, 0.1, 0.1}, 8);  // finer than the cells, for an even load
  World world(sceneWith(cube, {0, 0, 0.5}), coarse());
  world.advanceTo(0.0);
  Edit damped = editOf(EditKind::kMaterial), press = editOf(EditKind::kPressure),
       scale = editOf(EditKind::kTransform);
  damped.damping = 0.05;
  apply(world, damped);
  const Material material = world.plan()[0].material;
  press.pressure = kLoss * material.youngs_modulus / 3.0 / (1.0 - 2.0 * material.poissons_ratio);
  scale.scale = 2.0;
  apply(world, press);
  apply(world, scale);
  play(world, 2.0);
  cube.vertices = world.state().objects[0].vertices;
  EXPECT_NEAR(1.0 - signedVolume(cube) / std::pow(0.2, 3), kLoss, 0.05 * kLoss);
}

// A towel that two pegs hold by its upper corners.
WorldScene towel() {
  WorldScene scene = sceneWith(boxSurface({0.6, 0.01, 0.4}, 10), {0, 0, 2}, false);
  scene.objects[0].attachments = {{"left", {-1, -1, 2.19}, {-0.29, 1, 2.21}},
                                  {"right", {0.29, -1, 2.19}, {1, 1, 2.21}}};
  return scene;
}

Edit softer() {
  Edit edit = editOf(EditKind::kMaterial, EditMode::kFactor);
  edit.youngs_modulus = 0.8;
  return edit;
}

// How far an upper corner has come down since the object was scaled, m; side: -1 or 1.
double fallOfCorner(const World& world, double scale, int side) {
  const TriangleMesh mesh = towel().objects[0].mesh;
  double most = 0.0;
  for (int v = 0; v < mesh.vertexCount(); ++v)
    if (side * mesh.vertices(v, 0) > 0.299 && mesh.vertices(v, 2) > 0.199)
      most = std::max(most, 2.0 + scale * 0.2 - world.state().objects[0].vertices(v, 2));
  return most;
}

TEST(WorldChanges, WhatIsAttachedIsHeldByTheSamePointsWhenItIsScaled) {
  for (const double factor : {0.5, 1.2}) {
    World world(towel(), coarse());
    world.advanceTo(0.0);
    Edit scale = editOf(EditKind::kTransform);
    scale.scale = factor;
    apply(world, scale);
    play(world, 0.1);
    apply(world, softer());
    play(world, 0.4);
    for (const int side : {-1, 1})
      EXPECT_LT(std::abs(fallOfCorner(world, factor, side)), 1e-6) << factor;
  }
}

// A pole that sticks out from a wall: slender, so that a default stiffness would be raised.
TEST(WorldChanges, AGivenStiffnessOutlastsAScale) {
  WorldScene scene = sceneWith(boxSurface({1.0, 0.04, 0.04}, 4), {0, 0, 1}, false);
  scene.objects[0].attachments.push_back({"wall", {-0.6, -1, -1}, {-0.45, 1, 3}});
  World world(scene, coarse());
  world.advanceTo(0.0);
  Edit given = editOf(EditKind::kMaterial), scale = editOf(EditKind::kTransform);
  given.youngs_modulus = 1e6, scale.scale = 2.0;
  apply(world, given);
  apply(world, scale);
  EXPECT_EQ(world.plan()[0].material.youngs_modulus, 1e6);
}

TEST(WorldChanges, WhatWasReleasedIsNotHeldAgainWhenItIsScaled) {
  World world(towel(), coarse());
  world.advanceTo(0.0);
  Edit release = editOf(EditKind::kRelease), scale = editOf(EditKind::kTransform);
  release.region.kind = RegionKind::kBox;
  release.region.box_min = {0.2, -1, 1}, release.region.box_max = {1, 1, 3};
  scale.scale = 1.1;
  apply(world, release);
  apply(world, scale);
  play(world, 0.3);
  EXPECT_LT(std::abs(fallOfCorner(world, 1.1, -1)), 1e-6);
  EXPECT_GT(fallOfCorner(world, 1.1, 1), 0.01);
}

TEST(WorldChanges, AScaledBodyComesToRestOnItsSupport) {
  World world(box(), coarse());
  world.advanceTo(0.0);
  Edit scale = editOf(EditKind::kTransform);
  scale.scale = 0.5;
  apply(world, kindEdit(ObjectKind::kRigid));
  apply(world, scale);
  play(world, 0.5);
  EXPECT_NEAR(lowest(world.state()), 0.0, 2e-3);
}

TEST(WorldChanges, ARecolouredObjectIsStillStruck) {
  World world(twoBoxes({0.2, 0, 0.05}), coarse());
  world.advanceTo(0.0);
  Edit paint = editOf(EditKind::kAppearance), thrown = editOf(EditKind::kVelocity);
  paint.color = {1, 0, 0};
  thrown.vector = {3, 0, 0.5};
  apply(world, of("other", paint));
  EXPECT_EQ(world.state().objects[1].kind, ObjectKind::kStatic);
  apply(world, thrown);
  play(world, 0.3);
  EXPECT_EQ(world.state().objects[1].kind, ObjectKind::kRigid);
}

TEST(WorldChanges, WhatLiesOnARecolouredObjectFallsWithoutIt) {
  World world(twoBoxes({0, 0, 0.15}), coarse());
  world.advanceTo(0.0);
  Edit paint = editOf(EditKind::kAppearance);
  paint.color = {1, 0, 0};
  apply(world, paint);
  apply(world, of("other", paint));
  apply(world, editOf(EditKind::kRemove));
  play(world, 0.5);
  EXPECT_NEAR(centerOf(world.state(), 1).z(), 0.05, 5e-3);
}

TEST(WorldChanges, WhatIsNewFeelsTheScenesGravity) {
  World world(box(0.5), coarse());
  world.advanceTo(0.0);
  apply(world, slantedGravity({0, 0, -1.6}));
  WorldObject fresh = world.scene().objects[0];
  fresh.name = "fresh", fresh.index = 9;
  fresh.world_from_object.translation() = Eigen::Vector3d(0.5, 0, 2.0);
  world.addObject(fresh, {});
  apply(world, of("fresh", kindEdit(ObjectKind::kRigid)));
  play(world, 0.5);
  EXPECT_NEAR(centerOf(world.state(), 1).z(), 2.0 - 0.5 * 1.6 * 0.25, 0.03);
}

TEST(WorldChanges, UnderSlantingGravityWhatLiesSlides) {
  World world(box(), coarse());
  world.advanceTo(0.0);
  apply(world, slantedGravity({8, 0, -5}));
  play(world, 0.5);
  ASSERT_TRUE(world.state().objects[0].edited);
  EXPECT_GT(centerOf(world.state()).x(), 0.1);
}

// At any rate of frames, and with its weight.
TEST(WorldChanges, ARigidBodyReachesItsTarget) {
  for (const double rate : {60.0, 30.0, 15.0, 8.0}) {
    WorldParams params = coarse();
    params.frame_period = 1.0 / rate;
    World world(box(), params);
    world.advanceTo(0.0);
    Edit pull = editOf(EditKind::kPull, EditMode::kTarget);
    pull.vector = {0, 0, 0.08}, pull.ramp = 0.3;
    apply(world, kindEdit(ObjectKind::kRigid));
    apply(world, pull);
    for (int k = 1; k <= static_cast<int>(3.0 * rate); ++k) world.advanceTo(k / rate);
    EXPECT_NEAR(centerOf(world.state()).z(), 0.13, 2e-3) << rate << " frames a second";
  }
}

TEST(WorldChanges, ARigidBodyTurnsByMoreThanHalfATurnAndStops) {
  World world(box(0.5), coarse());
  world.advanceTo(0.0);
  Edit twist = editOf(EditKind::kTwist, EditMode::kTarget);
  twist.vector = {0, 0, 4.0}, twist.ramp = 1.0;
  apply(world, kindEdit(ObjectKind::kRigid));
  Edit hold = editOf(EditKind::kPull, EditMode::kTarget);
  apply(world, hold);
  apply(world, twist);
  play(world, 3.0);
  const Eigen::Matrix3d turned = world.state().objects[0].world_from_object.linear();
  EXPECT_NEAR(std::atan2(turned(1, 0), turned(0, 0)), 4.0 - 2.0 * M_PI, 0.02);
}

TEST(WorldChanges, ASleeperWakesWhenItsSupportGoes) {
  for (const ObjectKind kind : {ObjectKind::kDeformable, ObjectKind::kRigid})
    for (const EditKind goes : {EditKind::kRemove, EditKind::kTransform}) {
      World world(twoBoxes({0, 0, 0.15}), coarse());
      world.advanceTo(0.0);
      if (kind == ObjectKind::kRigid) apply(world, kindEdit(kind));
      apply(world, of("other", kindEdit(kind)));
      play(world, 3.0);
      ASSERT_TRUE(world.state().objects[1].sleeping);
      Edit edit = editOf(goes);
      edit.translation = {1, 0, 0};
      apply(world, edit);
      play(world, 0.5);
      EXPECT_LT(centerOf(world.state(), 1).z(), 0.08) << toString(kind) << ", " << toString(goes);
    }
}

TEST(WorldChanges, ASleeperWakesWhenSomethingIsPutIntoIt) {
  World world(twoBoxes({1, 0, 0.05}), coarse());
  world.advanceTo(0.0);
  apply(world, of("other", kindEdit(ObjectKind::kDeformable)));
  play(world, 2.0);
  ASSERT_TRUE(world.state().objects[1].sleeping);
  Edit move = editOf(EditKind::kTransform);
  move.translation = {0.92, 0.02, 0.01};
  apply(world, move);
  EXPECT_FALSE(world.state().objects[1].sleeping);
  play(world, 0.5);
  EXPECT_GT(centerOf(world.state(), 1).x(), 1.005);
}

TEST(WorldChanges, ASleeperSleepsOnWhenSomethingElseGoes) {
  World world(twoBoxes({1, 0, 0.05}), coarse());
  world.advanceTo(0.0);
  apply(world, of("other", kindEdit(ObjectKind::kRigid)));
  play(world, 3.0);
  for (const EditKind kind : {EditKind::kTransform, EditKind::kRemove}) {
    ASSERT_TRUE(world.state().objects[1].sleeping);
    apply(world, editOf(kind));
    play(world, 0.1);
    EXPECT_TRUE(world.state().objects[1].sleeping) << toString(kind);
  }
}

TEST(WorldChanges, AResetKeepsWhatTheVideoShowsOfCollisions) {
  World world(box(), coarse());
  world.addCollision("thing", 0.4);
  world.allCollisionsKnown();
  world.advanceTo(0.0);
  apply(world, editOf(EditKind::kReset));
  Edit after = editOf(EditKind::kVelocity);
  after.vector = {0, 0, 1}, after.after = "thing", after.collision = 1;
  world.submit(after);
  int accepted = 0;
  for (int k = 1; k <= 20; ++k)
    for (const EditOutcome& outcome : world.advanceTo(k / 30.0)) accepted += outcome.accepted;
  EXPECT_EQ(accepted, 1);
}

// In fast motion a frame's way is longer: what is met within it is set free before.
TEST(WorldChanges, WhatIsStruckInFastMotionIsSetFree) {
  World world(twoBoxes({0.3, 0, 0.05}), coarse());
  world.advanceTo(0.0);
  Edit fast = editOf(EditKind::kSpeedScale), thrown = editOf(EditKind::kVelocity);
  fast.object.clear(), fast.factor = 4.0;
  thrown.vector = {1.5, 0, 0.2};
  apply(world, fast);
  apply(world, thrown);
  play(world, 0.2);
  EXPECT_EQ(world.state().objects[1].kind, ObjectKind::kRigid);
  EXPECT_GT(centerOf(world.state(), 1).x(), 0.31);
}

}  // namespace
}  // namespace calipso::fem

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>

#include "calipso_fem/world/rigid_world.hpp"
#include "world_fixtures.hpp"

// Objects and pairs changed while the world runs.
namespace calipso::fem {
namespace {

using namespace test;

constexpr double kG = 9.81;

// A box falling freely from `height` above a table.
std::unique_ptr<World> dropped(double height, std::optional<ObjectKind> kind = std::nullopt) {
  WorldParams params;
  params.defaults.kind = kind;
  params.max_nodes = 100;
  auto world = std::make_unique<World>(
      sceneWith(boxSurface({0.1, 0.1, 0.1}, 2), {0, 0, 0.05 + height}), params);
  Edit heavy = editOf(EditKind::kGravity, EditMode::kFactor);
  heavy.factor = 2.0;  // afloat before: it falls with 1 g
  world->submit(heavy);
  world->advanceTo(0.0);
  return world;
}

double heightOf(const World& world, int object = 0) { return centerOf(world.state(), object).z(); }

TEST(WorldObjects, ExcludedPairFallsThrough) {
  const auto world = dropped(0.05);
  world->setPairContact("thing", "table", false);
  play(*world, 0.2);
  EXPECT_LT(heightOf(*world, 0), 0.0);
}

TEST(WorldObjects, EmptyNameMeansEverything) {
  const auto world = dropped(0.05);
  world->setPairContact("thing", "", false);
  EXPECT_FALSE(world->pairRule("table", "thing").contact);
  play(*world, 0.2);
  EXPECT_LT(heightOf(*world, 0), 0.0);
}

TEST(WorldObjects, RestitutionOfAPairOverrulesTheSurfaces) {
  const auto world = dropped(0.5);
  PairRule dead;
  dead.restitution = 0.0;
  world->setPairRule("thing", "table", dead);
  play(*world, 0.5);
  // Without restitution it lies where it fell: on the table within the margin of a rest.
  EXPECT_NEAR(heightOf(*world, 0), 0.05, 1e-3);
}

TEST(WorldObjects, RuleOutlivesARebuiltBody) {
  const auto world = dropped(0.05);
  world->setPairContact("thing", "table", false);
  Edit grow = editOf(EditKind::kTransform);
  grow.scale = 1.1;  // makes the body anew
  world->submit(grow);
  play(*world, 0.2);
  EXPECT_LT(heightOf(*world), 0.0);
}

TEST(WorldObjects, CopyOfARigidObjectMovesLikeTheOriginal) {
  const auto world = dropped(1.0);
  play(*world, 0.1);
  world->duplicate("thing", "copy", Eigen::Isometry3d(Eigen::Translation3d(0.5, 0, 0)));
  play(*world, 0.1);
  EXPECT_NEAR(heightOf(*world, 1), heightOf(*world, 0), 1e-12);
  EXPECT_EQ(world->state().objects[1].kind, ObjectKind::kRigid);
  EXPECT_EQ(world->scene().objects[1].name, "copy");
}

TEST(WorldObjects, CopyOfADeformedObjectHasItsShapeAndVelocity) {
  const auto world = dropped(1.0, ObjectKind::kDeformable);
  Edit spin = editOf(EditKind::kVelocity);
  spin.vector = {0, 0, 1};
  spin.angular = {0, 3, 0};
  world->submit(spin);
  play(*world, 0.1);
  world->duplicate("thing", "copy", Eigen::Isometry3d(Eigen::Translation3d(0.5, 0, 0)));
  play(*world, 0.1);
  const WorldState state = world->state();
  const auto shift = (state.objects[1].vertices - state.objects[0].vertices).eval();
  // Both are stepped from the same state with the same grid; only their place differs by round-off.
  EXPECT_LT((shift.rowwise() - Eigen::RowVector3d(0.5, 0, 0)).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(WorldObjects, BadNamesAndValuesAreRefused) {
  const auto world = dropped(1.0);
  const auto message = [](const std::function<void()>& f) {
    try {
      f();
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(message([&] { world->setPairContact("thing", "nothing", false); }).find("table"),
            std::string::npos);
  EXPECT_NE(message([&] { world->setPairContact("table", "table", false); }).find("no pair"),
            std::string::npos);
  EXPECT_NE(message([&] {
              world->duplicate("thing", "thing", Eigen::Isometry3d::Identity());
            }).find("two objects"),
            std::string::npos);
  PairRule rule;
  rule.friction = -0.1;
  EXPECT_NE(message([&] { world->setPairRule("thing", "table", rule); }).find("friction"),
            std::string::npos);
  SurfaceSettings surface;
  surface.restitution = 2.0;
  EXPECT_NE(message([&] { world->setSurface("thing", surface); }).find("restitution"),
            std::string::npos);
  EXPECT_EQ(world->scene().objects.size(), 1u);
}

TEST(WorldObjects, FirstTouchIsToldWithItsTimeAndSpeed) {
  for (const double pace : {1.0, 0.7}) {
    const auto world = dropped(0.5);
    Edit slow = editOf(EditKind::kSpeedScale);
    slow.object.clear(), slow.factor = pace;
    outcomeOf(*world, slow);
    std::vector<TouchEvent> events;
    for (int k = 1; k <= 20; ++k) {
      world->advanceTo(k / 30.0);
      for (const TouchEvent& e : world->state().first_touches) events.push_back(e);
    }
    ASSERT_FALSE(events.empty());  // and perhaps those of its bounces
    const double fall = std::sqrt(2.0 * 0.5 / kG);
    EXPECT_NEAR(events[0].time, fall / pace, 2e-3);  // the margin of a collision shape: 0.1 mm
    EXPECT_NEAR(events[0].approach_speed, kG * fall, 0.02 * kG * fall);
  }
}

// Several closed parts as one mesh; where they overlap it is not a manifold's surface.
TriangleMesh joined(const std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>& boxes) {
  TriangleMesh all;
  for (const auto& [size, at] : boxes) {
    TriangleMesh box = boxSurface(size, 1);
    box.vertices.rowwise() += at.transpose();
    const int v = all.vertexCount(), f = all.triangleCount();
    all.vertices.conservativeResize(v + box.vertexCount(), 3);
    all.vertices.bottomRows(box.vertexCount()) = box.vertices;
    all.triangles.conservativeResize(f + box.triangleCount(), 3);
    all.triangles.bottomRows(box.triangleCount()) = box.triangles.array() + v;
  }
  return all;
}

TEST(WorldObjects, ACupHoldsABall) {
  WorldScene scene = sceneWith(beaker(), {0, 0, 0.045});
  WorldObject ball = scene.objects.front();
  ball.name = "ball";
  ball.index = 2;
  ball.mesh = sphereSurface(0.015, 8, 12);
  ball.world_from_object.translation() = Eigen::Vector3d(0.012, 0, 0.2);
  scene.objects.push_back(ball);
  World world(scene, {});
  world.submit(editOf(EditKind::kVelocity));  // the cup stands and may move
  world.submit(letGo("ball"));
  world.advanceTo(0.0);
  play(world, 3.0);
  const Eigen::Isometry3d cup = world.state().objects[0].world_from_object;
  const Eigen::Vector3d at = cup.inverse() * centerOf(world.state(), 1);
  EXPECT_LT(at.head<2>().norm(), 0.034 - 0.015 + 1e-3);
  EXPECT_GT(at.z(), -0.045 + 0.006 + 0.015 - 1e-3);  // on its floor, not in it
  EXPECT_LT(at.z(), 0.0);
  EXPECT_GT(cup.linear()(2, 2), 0.99);
}

TEST(WorldObjects, ACupHangsByItsHandleOnAPeg) {
  const TriangleMesh mug = joined({{{0.08, 0.08, 0.1}, {0, 0, 0}},
                                   {{0.05, 0.012, 0.012}, {0.06, 0, 0.035}},
                                   {{0.05, 0.012, 0.012}, {0.06, 0, -0.035}},
                                   {{0.012, 0.012, 0.082}, {0.079, 0, 0}}});
  WorldScene scene = sceneWith(mug, {0, 0, 1.0}, false);
  TriangleMesh peg = boxSurface({0.01, 0.3, 0.01}, 1);
  peg.vertices.rowwise() += Eigen::RowVector3d(0.0565, 0, 1.015);
  scene.support_meshes.push_back({"peg", peg});
  World world(scene, {});
  world.submit(letGo("thing"));
  world.advanceTo(0.0);
  play(world, 4.0);
  // It hangs from the peg, its body beside or below it; without the peg it would be 78 m lower.
  const Eigen::Vector3d from_peg = centerOf(world.state()) - Eigen::Vector3d(0.0565, 0, 1.015);
  EXPECT_LT(from_peg.norm(), 0.12);
  EXPECT_LT(from_peg.z(), 0.0);
}

TEST(WorldObjects, WhatIsNoManifoldOrInsideOutFallsAndRests) {
  TriangleMesh fin = boxSurface({0.2, 0.2, 0.2}, 1);  // a third triangle on one edge
  fin.vertices.conservativeResize(fin.vertexCount() + 1, 3);
  fin.vertices.bottomRows(1) << 0.0, 0.0, 0.12;
  fin.triangles.conservativeResize(fin.triangleCount() + 1, 3);
  fin.triangles.bottomRows(1) << fin.triangles(0, 0), fin.triangles(0, 1), fin.vertexCount() - 1;
  TriangleMesh inward = boxSurface({0.2, 0.2, 0.2}, 2);
  inward.triangles.col(1).swap(inward.triangles.col(2));
  for (const TriangleMesh& mesh : {fin, inward})
    for (const ObjectKind kind : {ObjectKind::kRigid, ObjectKind::kDeformable}) {
      WorldParams params;
      params.defaults.kind = kind;
      params.defaults.cell_size = 0.05;
      World world(sceneWith(mesh, {0, 0, 0.15}), params);
      world.submit(letGo("thing"));
      world.advanceTo(0.0);
      play(world, 1.5);
      EXPECT_NEAR(world.state().objects[0].vertices.col(2).minCoeff(), 0.0, 2e-3);
      EXPECT_NE(world.plan()[0].reason.find('('), std::string::npos) << world.plan()[0].reason;
    }
}

TEST(WorldObjects, OverlapAtTheStartIsSaid) {
  for (const ObjectKind kind : {ObjectKind::kRigid, ObjectKind::kDeformable}) {
    WorldScene scene = sceneWith(boxSurface({0.2, 0.2, 0.2}, 2), {0, 0, 0.1});
    scene.objects.push_back(scene.objects.front());
    scene.objects[1].name = "other";
    scene.objects[1].index = 2;
    scene.objects[1].world_from_object.translation() += Eigen::Vector3d(0.18, 0.01, 0.0);
    WorldParams params;
    params.defaults.kind = kind;
    World world(scene, params);
    world.submit(editOf(EditKind::kVelocity));
    world.advanceTo(0.0);
    const std::string reason = world.plan()[0].reason;
    EXPECT_NE(reason.find("mm inside other"), std::string::npos) << reason;
    EXPECT_EQ(reason.find("inside table"), std::string::npos) << reason;
  }
}

TEST(WorldObjects, MassMustBePositive) {
  RigidWorld world;
  RigidBodySpec spec;
  spec.name = "anvil";
  spec.shapes = {boxSurface({1, 1, 1}, 1)};
  for (const double mass : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    spec.mass.mass = mass;
    try {
      world.add(spec);
      FAIL() << mass << " kg were accepted";
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find("anvil: mass"), std::string::npos);
    }
  }
  WorldParams params;
  params.defaults.density = 0.0;
  EXPECT_THROW(World(sceneWith(boxSurface({1, 1, 1}, 1), {0, 0, 1}), params),
               std::invalid_argument);
}

TEST(WorldObjects, NothingMovesWhatHasInfiniteMass) {
  RigidWorld world;
  RigidBodySpec spec;
  spec.name = "anvil";
  spec.shapes = {boxSurface({1, 1, 1}, 1)};
  spec.mass.mass = std::numeric_limits<double>::infinity();
  const RigidWorld::Id id = world.add(spec);
  world.setAcceleration(id, {0, 0, -9.81});
  world.push(id, {0, 0, -100}, {0.3, 0, 0.5});
  for (int k = 0; k < 30; ++k) world.step(1.0 / 30.0);
  EXPECT_TRUE(world.pose(id).matrix().isIdentity(0.0));
}

// What else the edit that makes it immovable says holds once it has a mass again.
TEST(WorldObjects, AnImmovableObjectKeepsTheRestOfItsMaterial) {
  std::vector<std::string> said;
  for (const double density : {std::numeric_limits<double>::infinity(), 2.0}) {
    World world(sceneWith(boxSurface({0.1, 0.1, 0.1}, 3), {0, 0, 0.5}), {});
    Edit first = editOf(EditKind::kMaterial, EditMode::kFactor),
         second = editOf(EditKind::kMaterial, EditMode::kAbsolute);
    first.density = density;
    first.youngs_modulus = 0.5;
    second.density = 500.0;
    world.submit(first);
    world.submit(second);
    const std::vector<EditOutcome> outcomes = world.advanceTo(0.0);
    ASSERT_EQ(outcomes.size(), 2u);
    for (const EditOutcome& outcome : outcomes) ASSERT_TRUE(outcome.accepted) << outcome.message;
    said.push_back(outcomes[1].message);
  }
  EXPECT_EQ(said[0], said[1]);
}

// A falling box stops on a floating one that an edit has made immovable; given a larger mass than
// it had, that falls.
TEST(WorldObjects, AnEditMakesMassInfinite) {
  WorldScene scene = sceneWith(boxSurface({0.1, 0.1, 0.1}, 3), {0, 0, 0.5});
  scene.objects.push_back(scene.objects.front());
  scene.objects[1].name = "above";
  scene.objects[1].world_from_object.translation().z() = 0.7;
  WorldParams params;
  params.max_nodes = 150;
  World world(scene, params);
  Edit heavy = editOf(EditKind::kMaterial, EditMode::kFactor),
       thrown = editOf(EditKind::kVelocity, EditMode::kAbsolute);
  heavy.density = std::numeric_limits<double>::infinity();
  thrown.object = "above";
  thrown.vector = {0, 0, -1};
  Edit falls = editOf(EditKind::kMaterial, EditMode::kAbsolute);
  falls.density = 2000.0;
  falls.time = 1.0;
  for (const Edit& edit : {heavy, thrown, falls}) world.submit(edit);
  for (const EditOutcome& outcome : world.advanceTo(0.0))
    EXPECT_TRUE(outcome.accepted) << outcome.message;
  play(world, 0.9);
  EXPECT_EQ(world.state().objects[0].kind, ObjectKind::kKinematic);
  EXPECT_NEAR(world.state().objects[0].world_from_object.translation().z(), 0.5, 1e-12);
  EXPECT_GT(world.state().objects[1].world_from_object.translation().z(), 0.59);
  play(world, 1.5);
  EXPECT_EQ(world.state().objects[0].kind, ObjectKind::kRigid);
  EXPECT_LT(world.state().objects[0].world_from_object.translation().z(), 0.3);
}

}  // namespace
}  // namespace calipso::fem

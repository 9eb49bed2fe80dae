#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <optional>

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

double heightOf(const World& world, int object = 0) {
  return centerOf(world.state(), object).z();
}

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
  EXPECT_NE(message([&] { world->setPairContact("thing", "thing", false); }).find("no pair"),
            std::string::npos);
  EXPECT_NE(message([&] { world->duplicate("thing", "thing", Eigen::Isometry3d::Identity()); })
                .find("two objects"),
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
  const auto world = dropped(0.5);
  std::vector<TouchEvent> events;
  for (int k = 1; k <= 12; ++k) {
    world->advanceTo(k / 30.0);
    for (const TouchEvent& e : world->state().first_touches) events.push_back(e);
  }
  ASSERT_FALSE(events.empty());  // and perhaps those of its bounces
  const double fall = std::sqrt(2.0 * 0.5 / kG);
  EXPECT_NEAR(events[0].time, fall, 2e-3);  // the margin of a collision shape takes 0.1 mm
  EXPECT_NEAR(events[0].approach_speed, kG * fall, 0.02 * kG * fall);
}

}  // namespace
}  // namespace calipso::fem

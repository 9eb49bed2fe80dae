#include <gtest/gtest.h>

#include <algorithm>

#include "world_fixtures.hpp"

// What rests on an object, and supports that are its own surface.
namespace calipso::fem {
namespace {

using namespace test;

// A thing whose top, 1.052 m high, is a support mesh as well (a bridge's deck), and a load on it.
WorldScene thingWithDeck() {
  TriangleMesh deck;
  deck.vertices.resize(4, 3);
  deck.vertices << -0.2, -0.1, 1.052, 0.2, -0.1, 1.052, 0.2, 0.1, 1.052, -0.2, 0.1, 1.052;
  deck.triangles.resize(2, 3);
  deck.triangles << 0, 1, 2, 0, 2, 3;
  WorldScene scene = sceneWith(boxSurface({0.4, 0.2, 0.1}, 2), {0, 0, 1.0});
  scene.support_meshes.push_back({"deck", deck});
  scene.objects.push_back(scene.objects.front());
  scene.objects[1].name = "load", scene.objects[1].index = 2;
  scene.objects[1].mesh = boxSurface({0.05, 0.05, 0.05}, 1);
  scene.objects[1].world_from_object.translation().z() = 1.08;
  return scene;
}

// When that falls, nothing stays in the air.
TEST(WorldRests, AnObjectTakesTheSupportThatIsItsOwnTopWithIt) {
  for (const ObjectKind kind : {ObjectKind::kRigid, ObjectKind::kDeformable}) {
    const WorldScene scene = thingWithDeck();
    WorldParams params;
    params.defaults.kind = kind;
    params.objects["load"].kind = ObjectKind::kRigid;
    World world(scene, params);
    world.submit(letGo("thing"));
    world.submit(letGo("load"));
    world.advanceTo(0.0);
    play(world, 2.0);
    EXPECT_NE(world.plan()[0].reason.find("deck is its own surface"), std::string::npos)
        << world.plan()[0].reason;
    EXPECT_LT(centerOf(world.state(), 1).z(), 0.3) << "rests on the fallen thing or beside it";
  }
}

TEST(WorldRests, ARemovedObjectTakesItsOwnTopWithItUntilItIsReset) {
  for (const bool reset : {false, true}) {
    WorldParams params;
    params.objects["load"].kind = ObjectKind::kRigid;
    World world(thingWithDeck(), params);
    Edit edit = letGo("thing");
    edit.kind = EditKind::kRemove;
    world.submit(edit);
    edit.kind = EditKind::kReset;
    if (reset) world.submit(edit);
    world.submit(letGo("load"));
    for (const EditOutcome& outcome : world.advanceTo(0.0))
      ASSERT_TRUE(outcome.accepted) << outcome.message;
    play(world, 2.0);
    const double height = centerOf(world.state(), 1).z();
    if (reset)
      EXPECT_NEAR(height, 1.077, 0.01);
    else
      EXPECT_LT(height, 0.1);
  }
}

// Placed elsewhere without physics, it takes it along, too.
TEST(WorldRests, AnObjectThatIsMovedTakesItsOwnTopWithIt) {
  World world(thingWithDeck(), {});
  Edit lower = editOf(EditKind::kTransform);
  lower.translation = {0, 0, -0.5};
  for (const Edit& edit : {letGo("load"), lower}) ASSERT_TRUE(outcomeOf(world, edit).accepted);
  play(world, 1.0);
  EXPECT_NEAR(centerOf(world.state(), 1).z(), 0.575, 5e-3);
}

TEST(WorldRests, NothingNewRestsOnTheTopOfWhatHasGone) {
  World world(thingWithDeck(), {});
  outcomeOf(world, editOf(EditKind::kRemove));
  play(world, 1.0);
  Edit copy = editOf(EditKind::kDuplicate);
  copy.object = "load", copy.new_name = "late";
  copy.translation = {0, 0, 1.2};
  ASSERT_TRUE(outcomeOf(world, copy).accepted);
  play(world, 1.0);
  EXPECT_LT(centerOf(world.state(), 2).z(), 0.2);
  outcomeOf(world, editOf(EditKind::kReset));
  EXPECT_TRUE(world.pairRule("late", "deck").contact);
}

TEST(WorldRests, AResetLeavesContactsThatTheUserHasEnded) {
  World world(thingWithDeck(), {});
  world.setPairContact("load", "deck", false);
  Edit edit = letGo("thing");
  for (const EditKind kind : {EditKind::kRemove, EditKind::kReset}) {
    edit.kind = kind;
    world.submit(edit);
    for (const EditOutcome& outcome : world.advanceTo(0.0))
      ASSERT_TRUE(outcome.accepted) << outcome.message;
    EXPECT_FALSE(world.pairRule("load", "deck").contact);
    EXPECT_EQ(world.pairRule("thing", "deck").contact, kind == EditKind::kReset);
  }
}

// What edits have changed is as before.
TEST(WorldRests, AResetUndoesWhatEditsHaveChangedOfContacts) {
  const auto wayAfter = [](bool edited) {
    World world(sceneWith(boxSurface({0.1, 0.1, 0.1}, 1), {0, 0, 0.05}), {});
    world.advanceTo(0.0);
    Edit smooth = editOf(EditKind::kContact), dead = smooth, apart = smooth;
    smooth.friction = 1e-3;
    dead.other = "table", dead.friction = 1e-3, dead.restitution = 1e-3;
    apart.meet = false;
    for (const Edit& edit : {smooth, dead, apart})
      EXPECT_TRUE(!edited || outcomeOf(world, edit).accepted);
    EXPECT_EQ(world.pairRule("thing", "table").contact, !edited);
    outcomeOf(world, editOf(EditKind::kReset));
    EXPECT_TRUE(world.pairRule("thing", "table").contact);
    EXPECT_FALSE(world.pairRule("thing", "table").friction);
    Edit thrown = editOf(EditKind::kVelocity);
    thrown.vector = {2, 0, 1};
    outcomeOf(world, thrown);
    play(world, 1.0);
    return centerOf(world.state());
  };
  EXPECT_EQ(wayAfter(true), wayAfter(false));
}

// A cup on a box.
WorldScene boxWithLoad(double height, bool table) {
  WorldScene scene = sceneWith(boxSurface({0.2, 0.2, 0.2}, 2), {0, 0, height}, table);
  scene.objects.push_back(scene.objects.front());
  scene.objects[1].name = "load", scene.objects[1].index = 2;
  scene.objects[1].mesh = boxSurface({0.05, 0.05, 0.05}, 1);
  scene.objects[1].world_from_object.translation().z() = height + 0.1255;
  return scene;
}

// It stays as the video has it while the box does, and falls when that is taken away or falls
// itself.
TEST(WorldRests, WhatRestsOnAnObjectFallsWhenThatMovesAway) {
  const WorldScene scene = boxWithLoad(0.5, false);
  for (const EditKind kind : {EditKind::kRemove, EditKind::kGravity, EditKind::kAppearance}) {
    World world(scene, {});
    Edit edit = letGo("thing");
    edit.kind = kind;
    if (kind == EditKind::kAppearance) edit.color = {1, 0, 0}, edit.mode = EditMode::kAbsolute;
    world.submit(edit);
    for (const EditOutcome& outcome : world.advanceTo(0.0))
      ASSERT_TRUE(outcome.accepted) << outcome.message;
    play(world, 1.0);
    const bool stays = kind == EditKind::kAppearance;
    EXPECT_EQ(world.state().objects[1].kind, stays ? ObjectKind::kStatic : ObjectKind::kRigid)
        << toString(kind);
    if (!stays) {
      EXPECT_LT(centerOf(world.state(), 1).z(), 0.3) << toString(kind);
    }
    EXPECT_EQ(world.plan()[1].reason.find("thing, on which it rests") == std::string::npos, stays)
        << world.plan()[1].reason;
  }
}

// Edited itself, it presses on what carries it from the first step on.
TEST(WorldRests, WhatRestsOnADeformableObjectDoesNotFallIntoItWhenItIsEdited) {
  WorldParams params = coarse();
  params.objects["thing"].kind = ObjectKind::kDeformable;
  World world(boxWithLoad(0.1, true), params);
  Edit edit = editOf(EditKind::kObjectKind);
  edit.object_kind = ObjectKind::kDeformable;
  outcomeOf(world, edit);
  edit.object = "load", edit.object_kind = ObjectKind::kRigid;
  outcomeOf(world, edit);
  play(world, 1.0 / 30.0);
  EXPECT_NEAR(centerOf(world.state(), 1).z(), 0.2255, 1e-3);
}

// Both are moved in the video after a second, and an edit of something else changes nothing there;
// taken away before, the box lets the load fall.
TEST(WorldRests, WhatTheVideoMovesWithItsCarrierStaysOnIt) {
  for (const EditKind kind : {EditKind::kSpeedScale, EditKind::kGravity})
    for (const bool removed : {false, true}) {
      const WorldScene scene = boxWithLoad(0.1, true);
      World world(scene, {});
      for (const WorldObject& object : scene.objects)
        for (int k = 0; k <= 60; ++k) {
          ObservedMotion seen;
          seen.time = k / 30.0;
          seen.moving = seen.time > 1.0;
          seen.linear.x() = seen.moving ? 0.1 : 0.0;
          seen.world_from_object = object.world_from_object;
          seen.world_from_object.translation().x() = 0.1 * std::max(0.0, seen.time - 1.0);
          world.addObservedMotion(object.name, seen);
        }
      Edit edit = editOf(kind, EditMode::kFactor);
      edit.object.clear(), edit.factor = 1.0;
      world.advanceTo(0.0);
      play(world, 0.2);
      ASSERT_TRUE(outcomeOf(world, edit).accepted);
      play(world, 0.2);
      if (removed) outcomeOf(world, editOf(EditKind::kRemove));
      play(world, 1.6);
      EXPECT_EQ(world.state().objects[1].kind, removed ? ObjectKind::kRigid : ObjectKind::kStatic)
          << world.plan()[1].reason;
    }
}

}  // namespace
}  // namespace calipso::fem

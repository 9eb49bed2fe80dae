#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "world_fixtures.hpp"

// What no body can be made of: edits that would need one are refused, and everything else goes on.
namespace calipso::fem {
namespace {

using namespace test;

// In the plane y = 0, without thickness.
TriangleMesh card() {
  TriangleMesh mesh;
  mesh.vertices.resize(4, 3);
  mesh.vertices << 0, 0, 0, 0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1;
  mesh.triangles.resize(2, 3);
  mesh.triangles << 0, 1, 2, 0, 2, 3;
  return mesh;
}

// A card that stands in the air, and a box beside it.
WorldScene cardAndBox() {
  WorldScene scene = sceneWith(card(), {0, 0, 0.5});
  scene.objects.push_back(scene.objects[0]);
  scene.objects[1].name = "box", scene.objects[1].index = 2;
  scene.objects[1].mesh = boxSurface({0.1, 0.1, 0.1}, 2);
  scene.objects[1].world_from_object.translation() = Eigen::Vector3d(0.05, -0.3, 0.55);
  return scene;
}

// At the card, which it reaches within a tenth of a second.
Edit throwOfTheBox() {
  Edit edit = editOf(EditKind::kVelocity);
  edit.object = "box", edit.vector = {0, 3, 0};
  return edit;
}

std::string refusal(World& world, const Edit& edit) {
  const EditOutcome outcome = outcomeOf(world, edit);
  EXPECT_FALSE(outcome.accepted) << outcome.message;
  return outcome.message;
}

void accept(World& world, const Edit& edit) {
  const EditOutcome outcome = outcomeOf(world, edit);
  EXPECT_TRUE(outcome.accepted) << outcome.message;
}

TEST(WorldRefusals, AFlatModelIsRefusedAndLeavesNothing) {
  World world(sceneWith(boxSurface({0.1, 0.1, 0.1}, 3), {0, 0, 0.05}), coarse());
  WorldObject object;
  object.name = "card", object.index = 2, object.mesh = card();
  try {
    world.addObject(object, {});
    FAIL() << "no error";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("card: "), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("thickness"), std::string::npos) << error.what();
  }
  EXPECT_EQ(world.state().objects.size(), 1u);
  world.advanceTo(0.0);
  EXPECT_NO_THROW(play(world, 0.2));
}

TEST(WorldRefusals, AFlatObjectStaysAsInTheVideoAndIsAWallForOthers) {
  World world(cardAndBox(), coarse());
  Edit rigid = editOf(EditKind::kObjectKind);
  rigid.object_kind = ObjectKind::kRigid;
  for (const Edit& edit : {editOf(EditKind::kVelocity), rigid})
    EXPECT_NE(refusal(world, edit).find("flat"), std::string::npos);
  EXPECT_FALSE(world.state().objects[0].edited);
  accept(world, throwOfTheBox());
  play(world, 0.5);
  EXPECT_EQ(world.state().objects[0].kind, ObjectKind::kStatic);
  EXPECT_LT(world.state().objects[1].vertices.col(1).maxCoeff(), 0.01);
  Edit pull = editOf(EditKind::kPull, EditMode::kForce);
  accept(world, pull);
  EXPECT_EQ(world.state().objects[0].kind, ObjectKind::kDeformable);
  EXPECT_NO_THROW(play(world, 0.1));
  accept(world, editOf(EditKind::kReset));
}

// What the video moves is a collider of another kind.
TEST(WorldRefusals, AFlatObjectThatTheVideoMovesIsAWallForOthers) {
  World world(cardAndBox(), coarse());
  for (int k = 0; k < 2; ++k) {
    ObservedMotion seen;
    seen.time = k, seen.moving = true, seen.linear = {0.01, 0, 0};
    seen.world_from_object.translation() = seen.centroid = Eigen::Vector3d(0.01 * k, 0, 0.5);
    world.addObservedMotion("thing", seen);
  }
  accept(world, throwOfTheBox());
  play(world, 0.3);
  EXPECT_EQ(world.state().objects[0].kind, ObjectKind::kStatic);
  EXPECT_LT(world.state().objects[1].vertices.col(1).maxCoeff(), 0.01);
  Edit move = editOf(EditKind::kTransform);
  move.translation = {0, 1, 0};
  accept(world, move);
}

TEST(WorldRefusals, ACellSizeThatIsTooSmallCostsTheObjectNothing) {
  WorldParams params = coarse();
  params.objects["thing"].cell_size = 0.0005;
  World world(sceneWith(boxSurface({1, 1, 1}, 2), {0, 0, 5}), params);
  EXPECT_NE(refusal(world, editOf(EditKind::kPull, EditMode::kForce)).find("cell_size"),
            std::string::npos);
  Edit thrown = editOf(EditKind::kVelocity);
  thrown.vector = {1, 0, 0};
  accept(world, thrown);
  play(world, 0.5);
  EXPECT_NEAR(centerOf(world.state()).x(), 0.5, 1e-6);
}

TEST(WorldRefusals, AScaleThatIsTooLargeChangesNothing) {
  WorldParams params = coarse();
  params.objects["thing"].cell_size = 0.05;
  World world(sceneWith(boxSurface({0.1, 0.1, 0.1}, 2), {0, 0, 0.5}), params);
  Edit soft = editOf(EditKind::kObjectKind), scale = editOf(EditKind::kTransform);
  soft.object_kind = ObjectKind::kDeformable;
  scale.scale = 1000.0, scale.translation = {1, 0, 0};
  accept(world, soft);
  const auto before = world.state().objects[0].vertices;
  EXPECT_NE(refusal(world, scale).find("cell_size"), std::string::npos);
  play(world, 0.1);
  EXPECT_LT((world.state().objects[0].vertices - before).norm(), 1e-6);
}

// One that cannot be made what the user wants of it is let go by nothing.
TEST(WorldRefusals, WhatCannotBeSetFreeStaysAndTheOthersGoOn) {
  WorldParams params = coarse();
  params.objects["thing"].cell_size = 1e-5;
  params.objects["thing"].kind = ObjectKind::kDeformable;
  WorldScene scene = cardAndBox();
  scene.objects[0].mesh = scene.objects[1].mesh;
  World world(scene, params);
  accept(world, throwOfTheBox());
  EXPECT_NO_THROW(play(world, 0.3));
  EXPECT_NE(world.plan()[0].reason.find("box strikes it, but it stays"), std::string::npos)
      << world.plan()[0].reason;
}

TEST(WorldRefusals, AnEditOfTheSceneReachesAllTheOthers) {
  for (const EditKind kind : {EditKind::kGravity, EditKind::kWind}) {
    World world(cardAndBox(), coarse());
    Edit edit = editOf(kind);
    edit.object.clear(), edit.vector = {30, 0, 0};
    const EditOutcome outcome = outcomeOf(world, edit);
    EXPECT_TRUE(outcome.accepted) << outcome.message;
    EXPECT_NE(outcome.message.find("thing stays: "), std::string::npos) << outcome.message;
    play(world, 0.3);
    EXPECT_GT(centerOf(world.state(), 1).x(), 0.06) << toString(kind);
  }
}

}  // namespace
}  // namespace calipso::fem

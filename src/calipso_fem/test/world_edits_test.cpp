#include <gtest/gtest.h>

#include "world_fixtures.hpp"

namespace calipso::fem {
namespace {

using namespace test;

World boxWorld() {
  return World(sceneWith(boxSurface({0.1, 0.1, 0.1}, 3), {0, 0, 0.05}), coarse());
}

std::string refusal(World& world, const Edit& edit) {
  world.submit(edit);
  const auto outcomes = world.advanceTo(0.0);
  EXPECT_EQ(outcomes.size(), 1u);
  EXPECT_FALSE(outcomes.at(0).accepted);
  return outcomes.at(0).message;
}

TEST(WorldEdits, UntouchedObjectIsAsInTheVideo) {
  World world = boxWorld();
  world.advanceTo(0.0);
  play(world, 0.5);
  const auto state = world.state().objects[0];
  EXPECT_FALSE(state.edited);
  EXPECT_EQ(state.kind, ObjectKind::kStatic);
  EXPECT_EQ(state.vertices.rows(), 0);
}

TEST(WorldEdits, UnknownObjectIsNamed) {
  World world = boxWorld();
  Edit edit = editOf(EditKind::kRemove);
  edit.object = "teapot";
  const std::string message = refusal(world, edit);
  EXPECT_NE(message.find("teapot"), std::string::npos);
  EXPECT_NE(message.find("thing"), std::string::npos);
}

TEST(WorldEdits, BadMaterialIsRefusedAndChangesNothing) {
  World world = boxWorld();
  Edit edit = editOf(EditKind::kMaterial, EditMode::kFactor);
  edit.youngs_modulus = -1.0;
  EXPECT_NE(refusal(world, edit).find("youngs_modulus = -1"), std::string::npos);
  EXPECT_FALSE(world.state().objects[0].edited);
}

TEST(WorldEdits, RegionBesideTheObjectIsRefused) {
  World world = boxWorld();
  Edit edit = editOf(EditKind::kFix);
  edit.region.kind = RegionKind::kSphere;
  edit.region.point = {5, 5, 5};
  EXPECT_NE(refusal(world, edit).find("enlarge"), std::string::npos);
}

TEST(WorldEdits, EstimatedVelocityNeedsAnEstimate) {
  World world = boxWorld();
  EXPECT_NE(refusal(world, editOf(EditKind::kVelocity, EditMode::kEstimated)).find("absolute"),
            std::string::npos);
}

TEST(WorldEdits, ReleaseOfNothingIsRefused) {
  World world = boxWorld();
  EXPECT_NE(refusal(world, editOf(EditKind::kRelease)).find("nothing is fixed"), std::string::npos);
}

TEST(WorldEdits, TransformMovesWithoutPhysics) {
  World world = boxWorld();
  Edit edit = editOf(EditKind::kTransform);
  edit.translation = {0, 0, 0.5};
  world.submit(edit);
  world.advanceTo(0.0);
  play(world, 0.5);
  const auto state = world.state();
  EXPECT_EQ(state.objects[0].kind, ObjectKind::kKinematic);
  EXPECT_NEAR((centerOf(state) - Eigen::Vector3d(0, 0, 0.55)).norm(), 0.0, 1e-12);
}

// What is placed pushes nothing away: the edit's report says what it is in.
TEST(WorldEdits, TransformIntoAnotherObjectIsSaid) {
  for (const bool into : {false, true}) {
    WorldScene scene = sceneWith(boxSurface({0.1, 0.1, 0.1}, 4), {0, 0, 0.05}, true);
    scene.objects.push_back(scene.objects.front());
    scene.objects.back().name = "other";
    scene.objects.back().world_from_object.translation() = Eigen::Vector3d(0.5, 0.01, 0.06);
    World world(scene, {});
    Edit edit = editOf(EditKind::kTransform);
    edit.translation = {into ? 0.405 : 0.39, 0, 0};
    const std::string said = outcomeOf(world, edit).message;
    EXPECT_EQ(said.find("mm inside other") != std::string::npos, into) << said;
  }
}

TEST(WorldEdits, ScaleKeepsTheCentroid) {
  World world = boxWorld();
  Edit edit = editOf(EditKind::kTransform);
  edit.scale = 2.0;
  world.submit(edit);
  world.advanceTo(0.0);
  const auto vertices = world.state().objects[0].vertices;
  EXPECT_NEAR((centerOf(world.state()) - Eigen::Vector3d(0, 0, 0.05)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(vertices.col(0).maxCoeff(), 0.1, 1e-12);
}

TEST(WorldEdits, RemoveAndReset) {
  World world = boxWorld();
  world.submit(editOf(EditKind::kRemove));
  world.submit(editOf(EditKind::kReset, EditMode::kAbsolute, 0.1));
  world.advanceTo(0.0);
  EXPECT_TRUE(world.state().objects[0].removed);
  play(world, 0.2);
  EXPECT_FALSE(world.state().objects[0].removed);
  EXPECT_FALSE(world.state().objects[0].edited);
}

TEST(WorldEdits, EditsTakeEffectAtTheirTime) {
  World world = boxWorld();
  Edit edit = editOf(EditKind::kTransform, EditMode::kAbsolute, 0.11);
  edit.translation = {0, 0, 0.5};
  world.submit(edit);
  EXPECT_TRUE(world.advanceTo(0.0).empty());
  EXPECT_TRUE(world.advanceTo(0.1).empty());
  const auto outcomes = world.advanceTo(0.2);
  ASSERT_EQ(outcomes.size(), 1u);
  EXPECT_EQ(outcomes[0].time, 0.2);
}

TEST(WorldEdits, LaterPullMakesTheObjectDeformableFromTheStart) {
  World world = boxWorld();
  world.submit(editOf(EditKind::kTransform));
  Edit pull = editOf(EditKind::kPull, EditMode::kForce, 1.0);
  pull.vector = {0, 0, 1};
  world.submit(pull);
  world.advanceTo(0.0);
  EXPECT_EQ(world.state().objects[0].kind, ObjectKind::kDeformable);
}

// The copy falls; the original stays where it was put.
TEST(WorldEdits, ALaterCopyLeavesTheOriginalAlone) {
  World world = boxWorld();
  Edit lift = editOf(EditKind::kTransform), copy = editOf(EditKind::kDuplicate);
  lift.translation = {0, 0, 0.3};
  copy.time = 1.0, copy.new_name = "twin", copy.translation = {0.3, 0, 0};
  world.submit(lift), world.submit(copy);
  world.advanceTo(0.0);
  play(world, 0.5);
  EXPECT_EQ(world.state().objects[0].kind, ObjectKind::kKinematic);
  EXPECT_NEAR(centerOf(world.state()).z(), 0.35, 1e-6);
}

TEST(WorldEdits, APixelShowsWhatTheVideoHasThere) {
  World world = boxWorld();
  WorldObject before;
  before.name = "before", before.index = 2, before.mesh = boxSurface({0.1, 0.1, 0.1}, 1);
  before.world_from_object.translation() = Eigen::Vector3d(0, -0.4, 0.05);
  world.addObject(before, {});
  Edit fix = editOf(EditKind::kFix);
  fix.region.kind = RegionKind::kPixel;
  const Camera& camera = world.scene().camera;
  fix.region.pixel = camera.projectWorld({0, -0.05, 0.05});
  world.submit(fix);
  const auto outcomes = world.advanceTo(0.0);
  ASSERT_EQ(outcomes.size(), 1u);
  EXPECT_TRUE(outcomes[0].accepted) << outcomes[0].message;
}

TEST(WorldEdits, WindEverywherePassesOverWhatIsHeld) {
  WorldScene scene = sceneWith(boxSurface({0.1, 0.1, 0.1}, 3), {0, 0, 0.05});
  scene.objects.push_back(scene.objects[0]);
  scene.objects[1].name = "other", scene.objects[1].index = 2;
  scene.objects[1].world_from_object.translation().x() = 0.5;
  World world(scene, coarse());
  Edit hold = editOf(EditKind::kObjectKind), wind = editOf(EditKind::kWind);
  hold.object = scene.objects[0].name, hold.object_kind = ObjectKind::kStatic;
  wind.object.clear(), wind.vector = {40, 0, 0};
  world.submit(hold), world.submit(wind);
  const auto outcomes = world.advanceTo(0.0);
  ASSERT_EQ(outcomes.size(), 2u);
  EXPECT_TRUE(outcomes[1].accepted) << outcomes[1].message;
  EXPECT_NE(outcomes[1].message.find("static and stays"), std::string::npos) << outcomes[1].message;
  EXPECT_EQ(world.state().objects[1].kind, ObjectKind::kRigid);
}

TEST(WorldEdits, SceneGravityLeavesWhatLiesOnTheTable) {
  World world = boxWorld();
  Edit edit = editOf(EditKind::kGravity, EditMode::kFactor);
  edit.object.clear();
  edit.factor = 3.0;
  world.submit(edit);
  ASSERT_TRUE(world.advanceTo(0.0).at(0).accepted);
  EXPECT_FALSE(world.state().objects[0].edited);
}

TEST(WorldEdits, TwoObjectsOfOneNameAreRefused) {
  WorldScene scene = sceneWith(boxSurface({1, 1, 1}, 1), {0, 0, 1});
  scene.objects.push_back(scene.objects.front());
  EXPECT_THROW(World(scene, {}), std::invalid_argument);
}

TEST(WorldEdits, NegativeFrictionIsRefused) {
  WorldParams params;
  params.defaults.surface.friction = -0.1;
  try {
    World world(sceneWith(boxSurface({1, 1, 1}, 1), {0, 0, 1}), params);
    FAIL() << "negative friction was accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("friction = -0.1"), std::string::npos);
  }
}

// A balloon of 1.2 kg/m^3, whose default density is water's, does not shoot up: that is what it has
// in the video. The next density is an edit of its weight, as is one above water's, or where the
// video's is given.
TEST(WorldEdits, FirstDensityOfWhatFloatsLeavesItAfloat) {
  struct Case {
    std::optional<double> given;
    std::vector<double> densities;  // kg/m^3
    double fall;                    // g
  };
  for (const Case& c : {Case{{}, {1.2}, 0.0}, Case{{}, {1.2, 2.4}, 0.5}, Case{{}, {4000.0}, 0.75},
                        Case{2.0, {4.0}, 0.5}}) {
    WorldParams params = coarse();
    params.defaults.density = c.given;
    World world(sceneWith(sphereSurface(0.5, 8, 12), {0, 0, 20}, false), params);
    for (const double density : c.densities) {
      Edit edit = editOf(EditKind::kMaterial, EditMode::kAbsolute);
      edit.density = density;
      world.submit(edit);
    }
    world.advanceTo(0.0);
    const double start = centerOf(world.state()).z(), t = 0.5;
    play(world, t);
    EXPECT_NEAR(centerOf(world.state()).z() - start, -0.5 * c.fall * 9.81 * t * t, 2e-3)
        << c.densities.back();
  }
}

}  // namespace
}  // namespace calipso::fem

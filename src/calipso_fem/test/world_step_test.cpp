#include <gtest/gtest.h>

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

}  // namespace
}  // namespace calipso::fem

#include "calipso_fem/world/rigid_world.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "../src/world/manifold_reduction.hpp"
#include "soft_scene.hpp"
#include "world_fixtures.hpp"

// Rigid bodies by themselves: analytic cases.
namespace calipso::fem {
namespace {

constexpr double kG = 9.81, kFriction = 0.5;
constexpr double kStep = 1.0 / 60.0;  // s

// A block that lies on a plane through the origin.
struct Block {
  RigidWorld world;
  RigidWorld::Id id = 0;
  Eigen::Vector3d start;

  Block(const Eigen::Vector3d& normal, const Eigen::Vector3d& velocity) {
    SurfaceSettings surface;
    surface.friction = kFriction;
    world.addPlane({"plane", normal, 0.0, std::nullopt}, surface);
    RigidBodySpec spec;
    spec.name = "block";
    spec.shapes = {test::boxSurface({0.2, 0.2, 0.1}, 1)};
    spec.mass = massProperties(spec.shapes.front(), 1000.0);
    spec.surface = surface;
    spec.world_from_object.linear() =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), normal).toRotationMatrix();
    spec.world_from_object.translation() = 0.05 * normal;
    spec.linear = velocity;
    id = world.add(spec);
    world.setAcceleration(id, {0, 0, -kG});
    start = world.center(id);
  }
  Eigen::Vector3d way(double seconds) {
    for (int k = 0; k < std::lround(seconds / kStep); ++k) world.step(kStep);
    return world.center(id) - start;
  }
};

TEST(RigidWorld, BlockSticksBelowAndSlidesAboveTheFrictionAngle) {
  for (const double factor : {0.99, 1.01, 1.3}) {
    const double angle = factor * std::atan(kFriction);
    Block block({std::sin(angle), 0, std::cos(angle)}, {0, 0, 0});
    const double expected =
        std::max(0.0, 0.5 * kG * (std::sin(angle) - kFriction * std::cos(angle)));
    EXPECT_NEAR(block.way(1.0).norm(), expected, 0.005 * expected + 1e-5) << factor;
  }
}

// A ring of points as sixteen parts would give, two of them deeper and one far: the ring's outline
// stays.
TEST(ManifoldReduction, KeepsTheDeepestAndTheOutline) {
  std::vector<btManifoldPoint> points(64);
  std::vector<btManifoldPoint*> contacts;
  for (int k = 0; k < 64; ++k) {
    const double angle = 2.0 * M_PI * k / 64, radius = k % 2 ? 0.9 : 1.0;
    points[k].m_normalWorldOnB = btVector3(0, 0, 1);
    points[k].m_positionWorldOnB = btVector3(radius * std::cos(angle), radius * std::sin(angle), 0);
    points[k].m_distance1 = k == 5 ? -0.01 : 0.0;
    contacts.push_back(&points[k]);
  }
  const auto redundant = redundantContacts(contacts);
  EXPECT_GE(redundant.size(), 64u - 9u);
  EXPECT_EQ(std::count(redundant.begin(), redundant.end(), &points[5]), 0);
  for (int direction = 0; direction < 8; ++direction) {
    const double angle = 2.0 * M_PI * direction / 8;
    double furthest = 0.0;
    for (const btManifoldPoint* p : contacts)
      if (std::count(redundant.begin(), redundant.end(), p) == 0)
        furthest = std::max(furthest, std::cos(angle) * p->m_positionWorldOnB.x() +
                                          std::sin(angle) * p->m_positionWorldOnB.y());
    EXPECT_GT(furthest, 0.9);
  }
  contacts.resize(8);
  EXPECT_TRUE(redundantContacts(contacts).empty());
}

// Whichever way it slides, over its edges or over a corner.
TEST(RigidWorld, FrictionIsTheSameInAllDirections) {
  const double v = 2.0, expected = v * v / (2.0 * kFriction * kG);
  for (const double direction : {0.0, 0.4, M_PI / 4}) {
    const Eigen::Vector3d ahead(std::cos(direction), std::sin(direction), 0);
    Block block(Eigen::Vector3d::UnitZ(), v * ahead);
    const Eigen::Vector3d way = block.way(1.0);
    EXPECT_NEAR(way.dot(ahead), expected, 0.005 * expected) << direction;
    EXPECT_LT((way - way.dot(ahead) * ahead).norm(), 0.005 * expected) << direction;
  }
}

// What Bullet reports as forces is what changes the velocity, and lies in the friction cone.
TEST(RigidWorld, ForcesOfASlidingBlockLieInTheConeAndAreAllThatBrakesIt) {
  Block block(Eigen::Vector3d::UnitZ(), {1, 1, 0});
  const double h = 1.0 / 1920.0;  // one sub-step
  const double mass = massProperties(test::boxSurface({0.2, 0.2, 0.1}, 1), 1000.0).mass;
  Eigen::Vector3d impulse = Eigen::Vector3d::Zero();
  const Eigen::Vector3d before = block.world.linearVelocity(block.id);
  for (int k = 0; k < 200; ++k) {
    block.world.step(h);
    for (const ContactPoint& c : block.world.contacts()) {
      impulse += h * c.force;
      const double normal = c.force.dot(c.normal);
      EXPECT_LE((c.force - normal * c.normal).norm(), kFriction * normal * (1.0 + 1e-3) + 1e-6);
    }
  }
  const Eigen::Vector3d weight(0, 0, -200 * h * mass * kG);
  const Eigen::Vector3d gained = mass * (block.world.linearVelocity(block.id) - before);
  EXPECT_LT((impulse + weight - gained).norm(), 1e-6 * gained.norm());
}

// A slab of two halves that lie side by side.
RigidBodySpec twoPartSlab(const std::string& name, double height) {
  RigidBodySpec spec;
  spec.name = name;
  for (const double x : {-0.1, 0.1})
    spec.shapes.push_back(test::movedMesh(test::boxSurface({0.2, 0.2, 0.1}, 1), {x, 0, 0}));
  spec.mass = massProperties(test::boxSurface({0.4, 0.2, 0.1}, 1), 1000.0);
  spec.world_from_object.translation().z() = height;
  return spec;
}

// Thrown up from the plane and from each other, they meet again where they had parted.
TEST(RigidWorld, BodiesOfSeveralPartsMeetAgainAfterTheyWereApart) {
  RigidWorld world;
  world.addPlane({"plane", Eigen::Vector3d::UnitZ(), 0.0, std::nullopt}, {});
  const RigidWorld::Id low = world.add(twoPartSlab("low", 0.06)),
                       high = world.add(twoPartSlab("high", 0.3));
  for (const RigidWorld::Id id : {low, high}) world.setAcceleration(id, {0, 0, -kG});
  for (const double thrown : {0.0, 3.0}) {
    world.setVelocity(low, {0, 0, thrown}, {0, 0, 0});
    world.setVelocity(high, {0, 0, 2.0 * thrown}, {0, 0, 0});
    for (int k = 0; k < 120; ++k) world.step(kStep);
    EXPECT_NEAR(world.center(low).z(), 0.05, 1e-3) << thrown;
    EXPECT_NEAR(world.center(high).z(), 0.15, 2e-3) << thrown;
  }
}

// Round and square bodies come to rest on a plane that ends, wherever they come down, as on an
// endless one; past its end they fall.
TEST(RigidWorld, BodiesRestOnAPlaneThatEnds) {
  for (const bool round : {true, false}) {
    for (const double x : {-1.0, -0.31, 0.02, 0.4, 1.7, 2.6, 3.3}) {
      RigidWorld world;
      world.addPlane({"step", Eigen::Vector3d::UnitZ(), 0.2, Eigen::Vector2d(-1.25, 3.0)}, {});
      RigidBodySpec spec;
      spec.name = "body";
      spec.shapes = {round ? test::sphereSurface(0.07, 16, 32)
                           : test::boxSurface({0.14, 0.14, 0.14}, 1)};
      spec.mass = massProperties(spec.shapes.front(), 300.0);
      spec.world_from_object.translation() = Eigen::Vector3d(x, 0.15, 0.5);
      const RigidWorld::Id id = world.add(spec);
      world.setAcceleration(id, {0, 0, -kG});
      for (int k = 0; k < 60; ++k) world.step(kStep);
      if (x < 3.0)
        EXPECT_NEAR(world.center(id).z(), 0.27, 2e-3) << round << " at " << x;
      else
        EXPECT_LT(world.center(id).z(), -2.0) << round << " at " << x;
    }
  }
}

// A floor of triangles, `cells` squares on a side, whose middle is the origin.
TriangleMesh triangulatedFloor(double size, int cells) {
  TriangleMesh floor;
  const int n = cells + 1;
  floor.vertices.resize(n * n, 3);
  for (int i = 0; i < n * n; ++i)
    floor.vertices.row(i) << size * (double(i % n) / cells - 0.5),
        size * (double(i / n) / cells - 0.5), 0.0;
  floor.triangles.resize(2 * cells * cells, 3);
  for (int y = 0, f = 0; y < cells; ++y)
    for (int x = 0; x < cells; ++x, f += 2) {
      const int a = y * n + x;
      floor.triangles.row(f) << a, a + 1, a + n + 1;
      floor.triangles.row(f + 1) << a, a + n + 1, a + n;
    }
  return floor;
}

// What slides over the edges between a floor's triangles goes straight on, at any scale and however
// its own axes lie: it neither rises nor turns.
TEST(RigidWorld, InnerEdgesOfAFloorStopNothing) {
  for (const double scale : {0.05, 10.0}) {
    for (const double turned : {0.0, 0.7}) {
      const double friction = 0.2, v = std::sqrt(scale * kG);
      RigidWorld world;
      RigidBodySpec floor, block;
      floor.name = "floor";
      floor.motion = RigidMotion::kStatic;
      floor.shapes = {triangulatedFloor(8.0 * scale, 40)};
      block.name = "block";
      block.shapes = {test::boxSurface(scale * Eigen::Vector3d(0.3, 0.9, 0.2), 1)};
      block.mass = massProperties(block.shapes.front(), 1000.0);
      floor.surface.friction = block.surface.friction = friction;
      block.world_from_object.linear() =
          Eigen::AngleAxisd(turned, Eigen::Vector3d::UnitZ()).toRotationMatrix();
      block.world_from_object.translation() = scale * Eigen::Vector3d(-3.0, 0.03, 0.1);
      block.linear = {v, 0, 0};
      world.add(floor);
      const RigidWorld::Id id = world.add(block);
      world.setAcceleration(id, {0, 0, -kG});
      const Eigen::Vector3d start = world.center(id);
      double highest = start.z();
      for (int k = 0; k < std::lround(v / (friction * kG) / kStep) + 30; ++k) {
        world.step(kStep);
        highest = std::max(highest, world.center(id).z());
      }
      const Eigen::Vector3d way = world.center(id) - start;
      EXPECT_NEAR(way.x(), v * v / (2.0 * friction * kG), 0.02 * scale) << scale << " " << turned;
      EXPECT_NEAR(way.y(), 0.0, 0.02 * scale) << scale << " " << turned;
      EXPECT_LT(highest - start.z(), 2e-3 * scale) << scale << " " << turned;
    }
  }
}

// Edges at which a surface does bend stop what comes against them as a wall does.
TEST(RigidWorld, BlockOfTrianglesStopsWhatSlidesAgainstIt) {
  RigidWorld world;
  world.addPlane({"plane", Eigen::Vector3d::UnitZ(), 0.0, std::nullopt}, {});
  RigidBodySpec step, block;
  step.name = "step";
  step.motion = RigidMotion::kStatic;
  step.shapes = {test::boxSurface({0.4, 2.0, 0.1}, 4)};
  step.world_from_object.translation() = Eigen::Vector3d(0.7, 0, 0.05);
  block.name = "block";
  block.shapes = {test::boxSurface({0.2, 0.2, 0.3}, 1)};
  block.mass = massProperties(block.shapes.front(), 1000.0);
  block.world_from_object.translation().z() = 0.15;
  block.linear = {2, 0, 0};
  world.add(step);
  const RigidWorld::Id id = world.add(block);
  world.setAcceleration(id, {0, 0, -kG});
  for (int k = 0; k < 120; ++k) world.step(kStep);
  EXPECT_LT(world.center(id).x(), 0.41);  // its front at the step's
  EXPECT_NEAR(world.center(id).z(), 0.15, 1e-3);
}

}  // namespace
}  // namespace calipso::fem

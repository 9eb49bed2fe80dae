#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "calipso_fem/world/soft_object.hpp"
#include "world_fixtures.hpp"

// The observed shape is at rest with the observed material, whatever the object is like.
namespace calipso::fem {
namespace {

using namespace test;

constexpr double kG = 9.81;
constexpr double kLimp = 2e5;  // Pa

Edit softer(double factor) {
  Edit edit = editOf(EditKind::kMaterial, EditMode::kFactor);
  edit.youngs_modulus = factor;
  return edit;
}

// A sheet held by one edge and out sideways: so soft that its weight bends it to the floor.
WorldScene banner() {
  WorldScene scene = sceneWith(boxSurface({1.0, 0.02, 0.6}, 6), {0, 0, 1.0}, false);
  AttachmentBox edge;
  edge.min = {-0.6, -1, -1};
  edge.max = {-0.45, 1, 3};
  scene.objects[0].attachments.push_back(edge);
  return scene;
}

struct Way {
  double largest = 0.0, end = 0.0;  // of a surface vertex, of the object's size
  std::string reason;
};

Way follow(const WorldScene& scene, double factor, double seconds,
           std::optional<double> modulus = std::nullopt) {
  WorldParams params;
  params.max_nodes = 300;
  params.defaults.youngs_modulus = modulus;
  World world(scene, params);
  world.submit(softer(factor));
  for (const EditOutcome& outcome : world.advanceTo(0.0))
    EXPECT_TRUE(outcome.accepted) << outcome.message;
  const WorldObject& object = scene.objects[0];
  const decltype(TriangleMesh::vertices) start =
      object.mesh.vertices.rowwise() + object.world_from_object.translation().transpose();
  Way way;
  for (int frame = 1; frame <= std::lround(30.0 * seconds); ++frame) {
    world.advanceTo(frame / 30.0);
    way.end = (world.state().objects[0].vertices - start).rowwise().norm().maxCoeff() /
              boundingDiagonal(object.mesh);
    way.largest = std::max(way.largest, way.end);
  }
  way.reason = world.plan()[0].reason;
  return way;
}

TEST(Settle, AShapeWithoutARestShapeStaysAsItIsAndSagsMoreTheSofterItIs) {
  const Way same = follow(banner(), 1.0, 1.0, kLimp);
  EXPECT_NE(same.reason.find("no rest shape"), std::string::npos) << same.reason;
  EXPECT_LT(same.largest, 1e-3);
  const double little = follow(banner(), 0.9, 0.3, kLimp).end,
               more = follow(banner(), 0.5, 0.3, kLimp).end;
  EXPECT_GT(little, 1e-3);
  EXPECT_GT(more, 1.5 * little);
  EXPECT_LT(follow(banner(), 10.0, 1.0, kLimp).largest, 1e-3);  // stiffer: nothing pushes it
}

// Four legs under a board, one of them shorter by three hundredths of its size.
TEST(Settle, WhatStandsOnUnevenFeetDoesNotTipOver) {
  TriangleMesh table = boxSurface({0.5, 0.5, 0.06}, 4);
  table.vertices.col(2).array() += 0.4;
  for (const int x : {-1, 1})
    for (const int y : {-1, 1}) {
      TriangleMesh leg = boxSurface({0.1, 0.1, 0.4}, 2);
      const bool is_short = x > 0 && y > 0;
      for (int v = 0; v < leg.vertexCount(); ++v)
        if (is_short && leg.vertices(v, 2) < -0.19) leg.vertices(v, 2) += 0.025;
      leg.vertices.rowwise() += Eigen::RowVector3d(0.2 * x, 0.2 * y, 0.2);
      const int before = table.vertexCount();
      const auto triangles = table.triangles;
      decltype(table.vertices) vertices(before + leg.vertexCount(), 3);
      vertices << table.vertices, leg.vertices;
      table.vertices = vertices;
      table.triangles.resize(triangles.rows() + leg.triangles.rows(), 3);
      table.triangles << triangles, (leg.triangles.array() + before).matrix();
    }
  const WorldScene scene = sceneWith(table, {0, 0, 0});
  EXPECT_LT(follow(scene, 1.0, 1.0).largest, 1e-3);
  const double little = follow(scene, 0.3, 1.0).end, more = follow(scene, 0.1, 1.0).end;
  EXPECT_GT(more, 1.5 * little);
  EXPECT_LT(more, 0.2);
}

// A pole that sticks out from a wall.
WorldScene pole() {
  WorldScene scene = sceneWith(boxSurface({1.0, 0.04, 0.04}, 4), {0, 0, 1.0}, false);
  AttachmentBox wall;
  wall.min = {-0.6, -1, -1};
  wall.max = {-0.45, 1, 3};
  scene.objects[0].attachments.push_back(wall);
  return scene;
}

// Half as stiff, it gets the sag once more that it has in the video: a few hundredths of its size,
// whatever its shape.
TEST(Settle, ASlenderObjectOfDefaultStiffnessBearsItsWeight) {
  const Way slender = follow(pole(), 0.5, 2.0);
  EXPECT_NE(slender.reason.find("slender"), std::string::npos) << slender.reason;
  EXPECT_GT(slender.largest, 0.01);
  EXPECT_LT(slender.largest, 0.1);
  const double by_size =
      defaultMaterial(boundingDiagonal(pole().objects[0].mesh), kG).youngs_modulus;
  const Way given = follow(pole(), 0.5, 2.0, by_size);
  EXPECT_EQ(given.reason.find("slender"), std::string::npos) << given.reason;
  EXPECT_GT(given.largest, 2.0 * slender.largest);
  const Way compact = follow(sceneWith(boxSurface({0.2, 0.2, 0.2}, 2), {0, 0, 0.1}), 0.5, 0.1);
  EXPECT_EQ(compact.reason.find("slender"), std::string::npos) << compact.reason;
}

struct Bar {  // held at one end, its material far too soft to be bent into this shape by gravity
  Bar() : soft(surface(), material(), options()) {
    DeformableBody& body = soft.body();
    for (int i = 0; i < body.nodeCount(); ++i)
      if (body.positions()[3 * i] < -0.45) body.fixNode(i);
    soft.setGravity({0, 0, -kG});
    std::vector<HoldPoint> hold;
    report = soft.settle({0, 0, -kG}, hold, 1e-4);
  }
  static TriangleMesh surface() { return boxSurface({1.0, 0.1, 0.1}, 4); }
  static Material material() {
    Material m = defaultMaterial(1.0, kG);
    m.youngs_modulus *= 0.02;
    return m;
  }
  static FemOptions options() {
    FemOptions o;
    o.cell_size = 0.05;
    o.static_most_load_steps = 4;
    return o;
  }
  SoftObject soft;
  SettleReport report;
};

// Set free to sag, it swings into its new equilibrium: no later swing is larger than the first.
TEST(Settle, APrestressedBodyGainsNoEnergy) {
  constexpr double kH = 1.0 / 60.0;
  constexpr int kSteps = 480;
  Bar bar;
  ASSERT_FALSE(bar.report.converged);
  Material material = Bar::material();
  material.youngs_modulus *= 0.99;
  bar.soft.setMaterial(material);
  DeformableBody& body = bar.soft.body();
  const Vec x = body.positions(), none = Vec::Zero(x.size());
  double fastest[2] = {0.0, 0.0},
         lowest[2] = {0.0, 0.0};  // J and m, of the first and of the second swing
  for (int step = 0; step < kSteps; ++step) {
    bar.soft.beginStep(kH);
    for (int k = 0; k < 4; ++k) body.moveTrial(body.trialPositions() + body.trialDirection(none));
    const int half = 2 * step / kSteps;
    fastest[half] =
        std::max(fastest[half], bar.soft.endStep(none, kH, std::nullopt).kinetic_energy);
    lowest[half] = std::max(lowest[half], (body.positions() - x).cwiseAbs().maxCoeff());
  }
  EXPECT_GT(lowest[0], 0.05);
  EXPECT_LT(lowest[1], lowest[0]);
  EXPECT_LT(fastest[1], fastest[0]);
}

// The prestress has no resultant: let go, the body falls like any other.
TEST(Settle, APrestressCarriesNothingThatIsLetGo) {
  Bar bar;
  DeformableBody& body = bar.soft.body();
  body.releaseAll();
  constexpr double kH = 1.0 / 60.0;
  const double mass = body.totalMass(), before = body.momentum().linear.z();
  bar.soft.beginStep(kH);
  const Vec none = Vec::Zero(3 * body.nodeCount());
  for (int k = 0; k < 6; ++k) body.moveTrial(body.trialPositions() + body.trialDirection(none));
  bar.soft.endStep(none, kH, std::nullopt);
  EXPECT_NEAR(body.momentum().linear.z() - before, -mass * kG * kH, 1e-3 * mass * kG * kH);
}

}  // namespace
}  // namespace calipso::fem

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "../src/world/obstacle_query.hpp"
#include "../src/world/self_proximity.hpp"
#include "soft_scene.hpp"
#include "world_fixtures.hpp"

// Deformable bodies that meet themselves.
namespace calipso::fem {
namespace {

using namespace test;

constexpr double kProximity = 5e-3;  // m, of SoftScene
constexpr double kStep = 1.0 / 60.0;

const Material kRubber{1e5, 0.3, 1000.0, 0.02};

SoftObject& addHorseshoe(SoftScene& scene) {
  scene.gravity.setZero();
  return scene.addSoft(horseshoe(0.12, 0.05, 0.03, 0.045, {16, 3, 2}), kRubber, 0.015);
}

// Plates press its arms towards each other, to half their distance within a second, and stay.
void squeeze(SoftScene& scene) {
  for (const double side : {1.0, -1.0})
    scene.addMoving(movedMesh(boxSurface({0.02, 0.2, 0.1}, 4), {0, 0, -0.1}), [side](double t) {
      return Eigen::Isometry3d(
          Eigen::Translation3d(side * (0.0755 - 0.045 * std::min(1.0, t / 0.8)), 0, 0));
    });
}

// How deep vertices of the surface are inside of it, m.
double depthInItself(SoftObject& soft) {
  const SurfaceTree& tree = soft.tree();
  const SelfProximity self(tree.mesh(), soft.body().embedding());
  double deepest = 0.0;
  for (int v = 0; v < tree.mesh().vertexCount(); ++v) {
    const Eigen::Vector3d x = tree.mesh().vertex(v);
    if (!encloses(tree.mesh(), x + 1e-6 * tree.vertexNormal(v).normalized())) continue;
    if (const auto hit = self.nearest(tree, v, x, 0.05, 0.0, 0.05))
      deepest = std::max(deepest, -hit->distance);
  }
  return deepest;
}

int selfContacts(SoftScene& scene) {
  const auto& all = scene.contacts().contacts();
  return static_cast<int>(
      std::count_if(all.begin(), all.end(), [](const auto& c) { return c.a == c.b; }));
}

TriangleMesh cloth(double length, double width, const Eigen::Vector3i& n) {
  return boxSurface({length, width, 0.004}, n);
}

TEST(SelfContact, TwoArmsCloseOnEachOtherAndHold) {
  for (const bool on : {false, true}) {
    SoftScene scene;
    SoftObject& soft = addHorseshoe(scene);
    squeeze(scene);
    soft.setSelfContact(on);
    double deepest = 0.0;
    int contacts = 0;
    for (int k = 0; k < 66; ++k) {
      scene.step(kStep);
      if (k % 6 == 5) deepest = std::max(deepest, depthInItself(soft));
      contacts = std::max(contacts, selfContacts(scene));
    }
    if (on) {
      EXPECT_GT(contacts, 5);
      EXPECT_LT(deepest, 0.1 * kProximity);
    } else {
      EXPECT_EQ(contacts, 0);
      EXPECT_GT(deepest, kProximity);  // without it they go into each other
    }
  }
}

TEST(SelfContact, KeepsMomentumAndGainsNoEnergy) {
  SoftScene scene;
  SoftObject& soft = addHorseshoe(scene);
  soft.setSelfContact(true);
  // The arms' ends swing towards each other; the whole flies and turns.
  DeformableBody& body = soft.body();
  const Vec x = body.positions();
  Vec v = body.velocities();
  for (int i = 0; i < body.nodeCount(); ++i) {
    const Eigen::Vector3d p = x.segment<3>(3 * i);
    v.segment<3>(3 * i) = Eigen::Vector3d(0.3, 0.2, 0.1) + Eigen::Vector3d(0.5, 0.4, 0.8).cross(p);
    if (p.z() < 0.0) v[3 * i] += 80.0 * (p.x() > 0.0 ? -1.0 : 1.0) * p.z() * p.z();
  }
  body.setState(x, v);
  soft.changed();
  const auto before = scene.momentum();
  double lowest = scene.energy();
  const double start = lowest;
  int contacts = 0;
  for (int k = 0; k < 40; ++k) {
    scene.step(1.0 / 120.0);
    contacts += selfContacts(scene);
    EXPECT_LT(scene.energy(), lowest + 1e-6 * start) << "step " << k;
    lowest = std::min(lowest, scene.energy());
  }
  ASSERT_GT(contacts, 0);
  const auto after = scene.momentum();
  EXPECT_LT((after - before).head<3>().norm(), 1e-9 * before.head<3>().norm());
  EXPECT_LT((after - before).tail<3>().norm(), 1e-9 * before.tail<3>().norm());
}

TEST(SelfContact, LayersOfAFoldingRibbonStayOnTheirSides) {
  SoftScene scene;
  scene.surface.friction = 0.4;
  scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
  TriangleMesh ribbon = cloth(0.4, 0.1, {20, 5, 1});
  ribbon.vertices =
      ribbon.vertices *
      Eigen::AngleAxisd(-1.55, Eigen::Vector3d::UnitY()).toRotationMatrix().transpose();
  SoftObject& soft =
      scene.addSoft(movedMesh(ribbon, {0, 0, 0.21}), {3e4, 0.3, 300.0, 0.02}, 0.02, {0, 0, -1.0});
  soft.setSelfContact(true);
  int contacts = 0;
  for (int k = 0; k < 40; ++k) {
    scene.step(kStep);
    contacts = std::max(contacts, selfContacts(scene));
    if (contacts > 0) {
      ASSERT_LT(depthInItself(soft), 0.1 * kProximity) << "step " << k;
    }
  }
  EXPECT_GT(contacts, 5);
}

TEST(SelfContact, WhereNothingMeetsItselfNothingChanges) {
  const auto run = [](bool on) {
    SoftScene scene;
    scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
    SoftObject& soft =
        scene.addSoft(movedMesh(horseshoe(0.12, 0.05, 0.03, 0.045, {12, 3, 2}), {0, 0, 0.2}),
                      kRubber, 0.02, {0, 0, -1});
    soft.setSelfContact(on);
    for (int k = 0; k < 15; ++k) scene.step(kStep);
    return Vec(soft.body().positions());
  };
  EXPECT_EQ((run(true) - run(false)).cwiseAbs().maxCoeff(), 0.0);
}

// A sheet that is not folded is never searched, however it moves; arms that are far apart are once.
TEST(SelfContact, WhatCannotMeetItselfIsNotSearched) {
  SoftScene scene;
  SoftObject& sheet = scene.addSoft(cloth(0.4, 0.2, {20, 10, 1}), {1e5, 0.3, 300.0, 0.02}, 0.02,
                                    {3, 0, 0}, {1, 2, 0});
  scene.gravity.setZero();
  SoftObject& arms =
      scene.addSoft(movedMesh(horseshoe(0.12, 0.05, 0.03, 0.045, {16, 3, 2}), {0, 2, 0}), kRubber,
                    0.015, {5, 0, 0}, {0, 1, 1});
  sheet.setSelfContact(true);
  arms.setSelfContact(true);
  for (int k = 0; k < 30; ++k) scene.step(kStep);
  EXPECT_EQ(sheet.selfProximity()->searches(), 0);
  EXPECT_EQ(arms.selfProximity()->searches(), arms.vertices().rows());
}

TEST(SelfContact, AFoldedSheetIsTold) {
  const TriangleMesh flat = cloth(0.4, 0.2, {20, 10, 1});
  FoldTest fold(flat);
  ASSERT_TRUE(fold.appliesTo());
  const auto rolled = [&](double angle) {  // about y, by `angle` from its middle to either end
    TriangleMesh mesh = flat;
    for (int v = 0; v < mesh.vertexCount(); ++v) {
      const double radius = 0.2 / angle, phi = mesh.vertices(v, 0) / radius,
                   r = radius + mesh.vertices(v, 2);
      mesh.vertices(v, 0) = r * std::sin(phi);
      mesh.vertices(v, 2) = r * std::cos(phi);
    }
    return SurfaceTree(mesh);
  };
  for (const auto& [angle, unfolded] :
       {std::pair(0.1, true), std::pair(0.9, true), std::pair(1.2, false)}) {
    const SurfaceTree tree = rolled(angle);
    fold.isUnfolded(tree);  // how fast it turns counts, too
    EXPECT_EQ(fold.isUnfolded(tree), unfolded) << angle;
  }
  EXPECT_FALSE(FoldTest(boxSurface({0.2, 0.2, 0.2}, 4)).appliesTo());
}

// A sheet bent by half a turn about y; its arms are 2 * `radius` apart.
TriangleMesh hairpin(const TriangleMesh& flat, double radius) {
  TriangleMesh mesh = flat;
  for (int v = 0; v < mesh.vertexCount(); ++v) {
    const double x = flat.vertices(v, 0), bent = 0.5 * M_PI * radius,
                 phi = std::clamp(x, -bent, bent) / radius, arm = std::abs(x) - bent,
                 r = radius + flat.vertices(v, 2);
    mesh.vertices(v, 0) = r * std::sin(phi);
    mesh.vertices(v, 2) = r * std::cos(phi) - std::max(0.0, arm);
  }
  return mesh;
}

TEST(SelfContact, OnlyPartsThatComeNearEachOtherAreSearched) {
  const TriangleMesh flat = cloth(0.4, 0.2, {40, 20, 1});
  const auto meeting = [&](double radius, double margin) {
    FoldTest fold(flat);
    const SurfaceTree tree(hairpin(flat, radius));
    EXPECT_FALSE(fold.isUnfolded(tree));
    fold.isUnfolded(tree);  // it does not turn on
    return fold.mayMeet(tree, Eigen::VectorXd::Zero(flat.vertexCount()), margin);
  };
  // Arms that are 10 cm apart: at most what is bent.
  const std::vector<int> bent = meeting(0.05, 0.01);
  EXPECT_LT(bent.size(), flat.vertexCount() / 10u);
  for (const int v : bent) EXPECT_LT(std::abs(flat.vertices(v, 0)), 0.1) << v;
  // 1 cm apart: all of them.
  const std::vector<int> near = meeting(0.005, 0.012);
  for (int v = 0; v < flat.vertexCount(); ++v) {
    const bool far_from_fold = std::abs(flat.vertices(v, 0)) > 0.03;
    EXPECT_TRUE(!far_from_fold || std::binary_search(near.begin(), near.end(), v)) << v;
  }
}

// A plate of 2 n + 1 by 2 n + 1 square cells, 1 cm wide and .2 mm thick, without every second one of
// every second row: n x n holes.
TriangleMesh grating(int n) {
  const int side = 2 * n + 1, corners = side + 1;
  const auto solid = [&](int i, int j) {
    return i >= 0 && j >= 0 && i < side && j < side && (i % 2 == 0 || j % 2 == 0);
  };
  TriangleMesh mesh;
  mesh.vertices.resize(2 * corners * corners, 3);
  const auto vertex = [&](int i, int j, int k) { return (k * corners + j) * corners + i; };
  for (int k = 0; k < 2; ++k)
    for (int j = 0; j < corners; ++j)
      for (int i = 0; i < corners; ++i)
        mesh.vertices.row(vertex(i, j, k)) << 0.01 * i, 0.01 * j, 0.0002 * k;
  std::vector<std::array<int, 3>> triangles;
  const auto quad = [&](int a, int b, int c, int d) {
    triangles.push_back({a, b, c});
    triangles.push_back({a, c, d});
  };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      if (!solid(i, j)) continue;
      const auto at = [&](int di, int dj, int k) { return vertex(i + di, j + dj, k); };
      quad(at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1));
      quad(at(0, 0, 0), at(0, 1, 0), at(1, 1, 0), at(1, 0, 0));
      if (!solid(i, j - 1)) quad(at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1));
      if (!solid(i, j + 1)) quad(at(1, 1, 0), at(0, 1, 0), at(0, 1, 1), at(1, 1, 1));
      if (!solid(i - 1, j)) quad(at(0, 1, 0), at(0, 0, 0), at(0, 0, 1), at(0, 1, 1));
      if (!solid(i + 1, j)) quad(at(1, 0, 0), at(1, 1, 0), at(1, 1, 1), at(1, 0, 1));
    }
  mesh.triangles.resize(static_cast<long>(triangles.size()), 3);
  for (size_t f = 0; f < triangles.size(); ++f)
    mesh.triangles.row(static_cast<long>(f)) << triangles[f][0], triangles[f][1], triangles[f][2];
  return mesh;
}

TEST(SelfContact, LatticesAreNotTakenForCloth) {
  EXPECT_TRUE(isThin(grating(1)));
  EXPECT_FALSE(isThin(grating(6)));
}

TEST(SelfContact, ThinOnesMeetThemselvesUnlessToldNotTo) {
  EXPECT_TRUE(isThin(cloth(0.4, 0.3, {8, 6, 1})));
  EXPECT_FALSE(isThin(boxSurface({0.4, 0.3, 0.05}, 4)));
  WorldParams params;
  params.defaults.youngs_modulus = 1e5;
  const auto contactOf = [&](const TriangleMesh& mesh) {
    World world(sceneWith(mesh, {0, 0, 1}, false), params);
    return world.pairRule("thing", "thing").contact;
  };
  EXPECT_TRUE(contactOf(cloth(0.4, 0.3, {8, 6, 1})));
  EXPECT_FALSE(contactOf(boxSurface({0.2, 0.2, 0.2}, 3)));
  params.defaults.self_contact = false;
  EXPECT_FALSE(contactOf(cloth(0.4, 0.3, {8, 6, 1})));
  params.defaults.self_contact = true;
  EXPECT_TRUE(contactOf(boxSurface({0.2, 0.2, 0.2}, 3)));
}

Edit selfEdit(bool meet) {
  Edit edit = editOf(EditKind::kContact);
  edit.other = "thing";
  edit.meet = meet;
  return edit;
}

std::string noteOf(const World& world) { return world.plan().front().reason; }

TEST(SelfContact, AnEditSwitchesIt) {
  World world(sceneWith(cloth(0.4, 0.3, {8, 6, 1}), {0, 0, 1}, false), WorldParams());
  world.submit(selfEdit(false));
  auto outcome = world.advanceTo(0.0);
  ASSERT_TRUE(outcome.front().accepted) << outcome.front().message;
  EXPECT_FALSE(world.pairRule("thing", "thing").contact);
  Edit slippery = selfEdit(true);
  slippery.friction = 0.1;
  world.submit(slippery);
  outcome = world.advanceTo(1.0 / 30.0);
  ASSERT_TRUE(outcome.front().accepted) << outcome.front().message;
  EXPECT_TRUE(world.pairRule("thing", "thing").contact);
  EXPECT_DOUBLE_EQ(world.pairRule("thing", "thing").friction.value(), 0.1);
  PairRule rough;
  rough.friction = -1.0;
  EXPECT_THROW(world.setPairRule("thing", "thing", rough), std::invalid_argument);
}

TEST(SelfContact, AnOpenSurfaceIsRefusedWithTheRemedy) {
  TriangleMesh open = boxSurface({0.2, 0.2, 0.2}, 3);
  open.triangles.conservativeResize(open.triangleCount() - 1, 3);
  World world(sceneWith(open, {0, 0, 1}, false), WorldParams());
  world.submit(editOf(EditKind::kRelease));
  Edit soft = editOf(EditKind::kObjectKind);
  soft.object_kind = ObjectKind::kDeformable;
  world.submit(soft);
  world.submit(selfEdit(true));
  const auto outcomes = world.advanceTo(0.0);
  ASSERT_FALSE(outcomes.back().accepted);
  EXPECT_NE(outcomes.back().message.find("give a closed one"), std::string::npos)
      << outcomes.back().message;
}

TEST(SelfContact, ASurfaceThatStartsInItselfIsReported) {
  // A ribbon in the form of an eight.
  TriangleMesh knot = cloth(0.6, 0.2, {24, 8, 1});
  for (int v = 0; v < knot.vertexCount(); ++v) {
    const double t = 1.55 + knot.vertices(v, 0) / 0.13;
    const Eigen::Vector2d across =
        Eigen::Vector2d(-0.2 * std::cos(2.0 * t), 0.15 * std::cos(t)).normalized();
    const Eigen::Vector2d middle(0.15 * std::sin(t), 0.1 * std::sin(2.0 * t));
    const Eigen::Vector2d at = middle + knot.vertices(v, 2) * across;
    knot.vertices(v, 0) = at.x();
    knot.vertices(v, 2) = at.y();
  }
  WorldParams params;
  params.defaults.kind = ObjectKind::kDeformable;
  World world(sceneWith(knot, {0, 0, 1}, false), params);
  world.submit(letGo("thing"));
  const auto outcomes = world.advanceTo(0.0);
  ASSERT_TRUE(outcomes.front().accepted) << outcomes.front().message;
  EXPECT_NE(noteOf(world).find("starts passing through itself"), std::string::npos)
      << noteOf(world);
}

}  // namespace
}  // namespace calipso::fem

#include "world_markers.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "world_fixtures.hpp"

// What the simulator shows in rviz, at every scale.
namespace calipso::fem::test {
namespace {

using visualization_msgs::Marker;

double lengthOf(const Marker& arrow) {
  const auto &a = arrow.points.at(0), &b = arrow.points.at(1);
  return std::hypot(b.x - a.x, b.y - a.y, b.z - a.z);
}

// A cube that fell on a table, a moment after it has struck.
visualization_msgs::MarkerArray landed(double side, bool soft) {
  WorldScene scene = sceneWith(boxSurface(Eigen::Vector3d::Constant(side), 2),
                               Eigen::Vector3d(0.0, 0.0, 0.52 * side));
  scene.objects[0].name = "thing";
  WorldParams params = coarse();
  params.objects["thing"] = params.defaults;
  params.objects["thing"].kind = soft ? ObjectKind::kDeformable : ObjectKind::kRigid;
  World world(std::move(scene), params);
  outcomeOf(world, letGo("thing"));
  play(world, 0.5);
  return toMarkers(world, "von_mises", ros::Time(1.0));
}

class MarkersAtScale : public ::testing::TestWithParam<std::pair<double, bool>> {};

TEST_P(MarkersAtScale, ContactForcesAreAsLongAsSuitsTheObject) {
  const auto [side, soft] = GetParam();
  int arrows = 0;
  double all = 0.0, longest = 0.0;
  for (const Marker& m : landed(side, soft).markers) {
    if (m.ns != "contacts") continue;
    ++arrows;
    all += lengthOf(m);
    longest = std::max(longest, lengthOf(m));
    EXPECT_GT(m.scale.x, 0.0);
    EXPECT_LT(m.scale.y, 0.25 * side);
  }
  EXPECT_GT(arrows, 0);
  EXPECT_LT(longest, std::sqrt(3.0) * side);
  EXPECT_GT(all, 0.2 * side) << "what carries the weight is to be seen";
}

TEST_P(MarkersAtScale, NothingIsWithoutExtentOrFarLargerThanTheScene) {
  const auto [side, soft] = GetParam();
  for (const Marker& m : landed(side, soft).markers) {
    if (m.action != Marker::ADD) continue;
    const bool is_list = m.type != Marker::ARROW && m.type != Marker::CUBE;
    if (is_list) {
      EXPECT_FALSE(m.points.empty()) << m.ns;
    }
    EXPECT_GT(m.scale.x, 0.0) << m.ns;
    if (m.type != Marker::TRIANGLE_LIST) {
      EXPECT_LT(m.scale.x, 10.0 * side) << m.ns;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Scales, MarkersAtScale,
                         ::testing::Values(std::pair{0.05, false}, std::pair{0.05, true},
                                           std::pair{50.0, false}, std::pair{50.0, true}));

TEST(Markers, WhatIsRemovedIsNotDrawn) {
  WorldScene scene = sceneWith(boxSurface(Eigen::Vector3d::Constant(0.1), 2), {0.0, 0.0, 0.5});
  scene.objects[0].name = "thing";
  World world(std::move(scene), coarse());
  Edit remove = editOf(EditKind::kRemove);
  remove.object = "thing";
  outcomeOf(world, remove);
  for (const Marker& m : toMarkers(world, "von_mises", ros::Time(1.0)).markers) {
    if (m.action == Marker::ADD) {
      EXPECT_EQ(m.ns, "support");
    }
  }
}

}  // namespace
}  // namespace calipso::fem::test

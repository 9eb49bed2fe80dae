#include "calipso_render/sky_map.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

namespace calipso::render {
namespace {

const Eigen::Vector3f kUp = Eigen::Vector3f::UnitZ();

struct Box {
  Points vertices;
  Triangles triangles;
};

Box box(const Eigen::Vector3f& low, const Eigen::Vector3f& high) {
  Box b;
  for (int k = 0; k < 8; ++k)
    b.vertices.push_back(
        {k & 1 ? high.x() : low.x(), k & 2 ? high.y() : low.y(), k & 4 ? high.z() : low.z()});
  b.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                 {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return b;
}

// Part of the disc of sky over p that a box leaves, by its slabs. @param turn of the box about the origin
float seenPast(const Eigen::AlignedBox3f& box, const Eigen::AngleAxisf& turn,
               const Eigen::Vector3f& p) {
  constexpr int kRays = 500;
  const Eigen::Vector3f from = turn.inverse() * p;
  int open = 0;
  for (int k = 0; k < kRays; ++k) {
    const float r = std::tan(kSkyRadius) * std::sqrt((k + 0.5f) / kRays), a = 2.39996323f * k;
    const Eigen::Array3f ray =
        turn.inverse() * Eigen::Vector3f(r * std::cos(a), r * std::sin(a), 1.0f);
    const Eigen::Array3f one = (box.min() - from).array() / ray,
                         other = (box.max() - from).array() / ray;
    open +=
        one.min(other).maxCoeff() > one.max(other).minCoeff() || one.max(other).minCoeff() < 0.0f;
  }
  return static_cast<float>(open) / kRays;
}

// Of a box on the plane, of one that hovers a hundredth of its size over it, and of one that
// stands on its edge: everywhere around, also in the gap below.
TEST(SkyMap, IsWhatABoxLeavesOfTheSky) {
  const Eigen::AngleAxisf level(0.0f, Eigen::Vector3f::UnitX()),
      on_edge(0.25f * static_cast<float>(M_PI), Eigen::Vector3f::UnitX());
  const Eigen::Vector3f half(0.5f, 0.5f, 0.5f), centre(0.0f, 0.0f, 0.5f),
      hovering(0.0f, 0.0f, 0.51f),
      edge(0.0f, 0.5f, 0.5f);  // before the turn: over the origin after it
  for (const auto& [turn, middle] :
       {std::pair(level, centre), std::pair(level, hovering), std::pair(on_edge, edge)}) {
    Box b = box(middle - half, middle + half);
    for (Eigen::Vector3f& p : b.vertices) p = turn * p;
    const SkyMap map({{&b.vertices, &b.triangles}}, Eigen::Vector3d::UnitZ(), {});
    double sum = 0.0;
    int count = 0, dark = 0;
    for (float x = -2.0f; x <= 2.0f; x += 0.043f) {
      for (float y = -2.0f; y <= 2.0f; y += 0.047f) {
        const float seen = map.visibility({x, y, 0.0f}, kUp),
                    truth = seenPast({middle - half, middle + half}, turn, {x, y, 0.0f});
        sum += std::abs(seen - truth), ++count;
        dark += truth < 0.1f && seen < 0.15f;
        // A direction is 0.04. Beside an edge a texel opens or closes half of them.
        const bool beside =
            std::abs(std::abs(x) - 0.5f) < 0.02f || std::abs(std::abs(y) - 0.5f) < 0.02f;
        if (!beside) {
          EXPECT_NEAR(seen, truth, 0.2f) << x << ", " << y << ", " << middle.z();
        }
      }
    }
    EXPECT_LT(sum / count, 0.025);  // about half a direction
    EXPECT_GT(dark, 50);
  }
}

// Two thousand texels over the plane, of a box a direction or none is hidden.
TEST(SkyMap, WhatIsHighUpHidesNoMoreThanItCovers) {
  const Eigen::AlignedBox3f high(Eigen::Vector3f(-0.5f, -0.5f, 16.0f),
                                 Eigen::Vector3f(0.5f, 0.5f, 17.0f));
  const Box b = box(high.min(), high.max());
  const SkyMap map({{&b.vertices, &b.triangles}}, Eigen::Vector3d::UnitZ(), {});
  const Eigen::AngleAxisf level(0.0f, Eigen::Vector3f::UnitX());
  for (float x = -12.0f; x <= 12.0f; x += 0.37f) {
    for (float y = -12.0f; y <= 12.0f; y += 0.41f)
      EXPECT_NEAR(map.visibility({x, y, 0.0f}, kUp), seenPast(high, level, {x, y, 0.0f}), 0.06f)
          << x << ", " << y;
  }
}

TEST(SkyMap, ASheetThatLiesOnThePlaneHidesNothing) {
  const Points sheet = {{-1, -1, 0.001f}, {1, -1, 0}, {1, 1, 0.001f}, {-1, 1, 0}};
  const Triangles faces = {{0, 1, 2}, {0, 2, 3}};
  const SkyMap map({{&sheet, &faces}}, Eigen::Vector3d::UnitZ(), {});
  EXPECT_FLOAT_EQ(map.visibility({0.1f, 0.2f, 0.0f}, kUp), 1.0f);
}

TEST(SkyMap, OfThePlanesTiltOnlyTheHeightOverItMatters) {
  const Box b = box({-0.5f, -0.5f, 0.0f}, {0.5f, 0.5f, 1.0f});
  Box turned = b;
  const Eigen::AngleAxisf turn(0.7f, Eigen::Vector3f(1, 2, 0).normalized());
  for (Eigen::Vector3f& p : turned.vertices) p = turn * p;
  const Eigen::Vector3f up = turn * kUp;
  const SkyMap flat({{&b.vertices, &b.triangles}}, Eigen::Vector3d::UnitZ(), {}),
      tilted({{&turned.vertices, &turned.triangles}}, up.cast<double>(), {});
  for (float x = 0.55f; x < 1.5f; x += 0.1f)
    EXPECT_NEAR(flat.visibility({x, 0, 0}, kUp),
                tilted.visibility(turn * Eigen::Vector3f(x, 0, 0), up),
                0.09f)
        << x;  // two directions: the discs' points are turned
}

TEST(SkyMap, WhatNothingHidesIsToldAtOnce) {
  const Box b = box({-0.5f, -0.5f, 0.0f}, {0.5f, 0.5f, 1.0f});
  const SkyMap map({{&b.vertices, &b.triangles}}, Eigen::Vector3d::UnitZ(), {});
  EXPECT_EQ(map.uniform({3, 0, 0}, kUp, 0.5f), std::optional<float>(1.0f));
  EXPECT_EQ(map.uniform({0, 0, 2}, kUp, 0.5f), std::optional<float>(1.0f));
  EXPECT_FALSE(map.uniform({1, 0, 0}, kUp, 0.1f));
  EXPECT_TRUE(SkyMap({}, Eigen::Vector3d::UnitZ(), {}).empty());
}

}  // namespace
}  // namespace calipso::render

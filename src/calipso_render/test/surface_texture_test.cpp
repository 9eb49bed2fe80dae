#include "calipso_render/surface_texture.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "calipso_render/colour.hpp"
#include "calipso_render/surface_symmetry.hpp"
#include "texture/texture_seams.hpp"

namespace calipso::render {
namespace {

// A box of 2 x 1 x 0.5 with its middle at (1, 2, 3), every side split in the middle.
void makeBox(Points& vertices, Triangles& triangles) {
  const Eigen::Vector3f middle(1, 2, 3), half(1.0f, 0.5f, 0.25f);
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.0f, 1.0f}) {
      const int s = (axis + 1) % 3, t = (axis + 2) % 3, first = static_cast<int>(vertices.size());
      for (const auto& [a, b] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}, {0, 0}}) {
        Eigen::Vector3f p;
        p[axis] = side, p[s] = static_cast<float>(a), p[t] = static_cast<float>(b);
        vertices.push_back(middle + p.cwiseProduct(half));
      }
      for (int k = 0; k < 4; ++k) triangles.push_back({first + k, first + (k + 1) % 4, first + 4});
    }
  }
}

TEST(SurfaceTexture, InterpolatesALinearFunctionExactly) {
  Points vertices = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}};
  const Triangles triangles = {{0, 1, 2}};
  SurfaceTexture texture(vertices, triangles, 0.3f, 1000);
  ASSERT_GT(texture.size(), 10u);
  const auto value = [](const Eigen::Vector3f& w) {
    return cv::Vec4f(w[0], 2.0f * w[1], w[0] - w[2], 1.0f);
  };
  for (std::size_t i = 0; i < texture.size(); ++i)
    texture.texels[i] = value(texture.weightsOf(0, i));
  for (const Eigen::Vector3f& w :
       {Eigen::Vector3f(1, 0, 0), Eigen::Vector3f(0, 0, 1), Eigen::Vector3f(0.31f, 0.33f, 0.36f),
        Eigen::Vector3f(0.05f, 0.9f, 0.05f)}) {
    for (int c = 0; c < 4; ++c)
      EXPECT_NEAR(texture.at(0, w)[c], value(w)[c], 1e-5f) << w.transpose();
  }
}

TEST(SurfaceTexture, GetsCoarserRatherThanTooLarge) {
  Points vertices;
  Triangles triangles;
  makeBox(vertices, triangles);
  EXPECT_LE(SurfaceTexture(vertices, triangles, 1e-4f, 500).size(), 500u);
}

TEST(MirrorPlanes, OfABoxAreItsThreeMiddlePlanes) {
  Points vertices;
  Triangles triangles;
  makeBox(vertices, triangles);
  const std::vector<MirrorPlane> planes = mirrorPlanes(vertices, triangles);
  ASSERT_EQ(planes.size(), 3u);
  for (const MirrorPlane& p : planes) {
    EXPECT_NEAR(p.normal.cwiseAbs().maxCoeff(), 1.0f, 1e-4f);
    EXPECT_NEAR(p.normal.dot(Eigen::Vector3f(1, 2, 3)), p.offset, 1e-4f);
  }
}

TEST(MirrorPlanes, OfABoxOfTwoTrianglesToASideAreTheSame) {
  Points vertices;
  for (int i = 0; i < 8; ++i) vertices.push_back({5.0f * (i & 1), 2.0f * (i & 2), 0.75f * (i & 4)});
  const std::vector<MirrorPlane> planes = mirrorPlanes(vertices, {{0, 4, 6},
                                                                  {0, 6, 2},
                                                                  {1, 3, 7},
                                                                  {1, 7, 5},
                                                                  {0, 1, 5},
                                                                  {0, 5, 4},
                                                                  {2, 6, 7},
                                                                  {2, 7, 3},
                                                                  {0, 2, 3},
                                                                  {0, 3, 1},
                                                                  {4, 5, 7},
                                                                  {4, 7, 6}});
  ASSERT_EQ(planes.size(), 3u);
  for (const MirrorPlane& p : planes) EXPECT_NEAR(p.normal.cwiseAbs().maxCoeff(), 1.0f, 1e-4f);
}

TEST(MirrorPlanes, OfALopsidedShapeAreNone) {
  const Points vertices = {{0, 0, 0}, {3, 0, 0}, {0, 1, 0}, {0.5f, 0.2f, 0.7f}};
  EXPECT_TRUE(mirrorPlanes(vertices, {{0, 1, 2}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}).empty());
}

// A vase turned about a slanting axis, with a plate stuck to its side as a handle.
TEST(RevolutionAxis, IsFoundWhateverIsAttached) {
  const Eigen::Vector3f point(0.3f, -0.2f, 1.0f),
      up = Eigen::Vector3f(0.3f, 0.2f, 1.0f).normalized();
  const Eigen::Vector3f side = up.unitOrthogonal(), other = up.cross(side);
  Points vertices;
  Triangles triangles;
  constexpr int kAround = 24, kAlong = 12;
  for (int j = 0; j <= kAlong; ++j) {
    const float height = 0.3f * j / kAlong, radius = 0.06f + 0.02f * std::sin(9.0f * height);
    for (int i = 0; i < kAround; ++i) {
      const float angle = 2.0f * static_cast<float>(M_PI) * i / kAround;
      vertices.push_back(point + up * height +
                         radius * (side * std::cos(angle) + other * std::sin(angle)));
    }
  }
  for (int j = 0; j < kAlong; ++j) {
    for (int i = 0; i < kAround; ++i) {
      const int a = j * kAround + i, b = j * kAround + (i + 1) % kAround;
      triangles.push_back({a, b, a + kAround}), triangles.push_back({b, b + kAround, a + kAround});
    }
  }
  const int first = static_cast<int>(vertices.size());
  for (const auto& [a, h] : {std::pair{0.08f, 0.1f}, {0.2f, 0.1f}, {0.2f, 0.2f}, {0.08f, 0.2f}})
    vertices.push_back(point + up * h + side * a);
  triangles.push_back({first, first + 1, first + 2}),
      triangles.push_back({first, first + 2, first + 3});

  const std::optional<Axis> axis = revolutionAxis(vertices, triangles);
  ASSERT_TRUE(axis);
  EXPECT_GT(std::abs(axis->direction.dot(up)), 0.9999f);
  EXPECT_LT((axis->point - point).cross(axis->direction).norm(), 1e-3f);
}

TEST(RevolutionAxis, OfABoxIsNone) {
  Points vertices;
  Triangles triangles;
  makeBox(vertices, triangles);
  EXPECT_FALSE(revolutionAxis(vertices, triangles));
}

// The values known at the ends of a strip run evenly between them; a second vertex at a known place
// is known too.
TEST(DiffuseOverMesh, IsHarmonic) {
  Points vertices;
  Triangles triangles;
  for (int i = 0; i < 5; ++i) vertices.emplace_back(i, 0, 0), vertices.emplace_back(i, 1, 0);
  for (int i = 0; i < 4; ++i)
    triangles.push_back({2 * i, 2 * i + 2, 2 * i + 1}),
        triangles.push_back({2 * i + 1, 2 * i + 2, 2 * i + 3});
  vertices.emplace_back(4, 0, 0);
  std::vector<bool> known(vertices.size(), false);
  std::vector<cv::Vec3f> values(vertices.size());
  known[0] = known[1] = known[8] = known[9] = true;
  values[8] = values[9] = {1, 1, 1};
  diffuseOverMesh(vertices, triangles, known, values);
  EXPECT_NEAR(values[4][0] + values[5][0], 1.0f,
              0.02f);  // the middle; the pull to the mean is 1e-4
  EXPECT_LT(values[2][0], values[4][0]);
  EXPECT_LT(values[4][0], values[6][0]);
  EXPECT_FLOAT_EQ(values[10][0], 1.0f);
}

// A strip of which one end is known: near it its value goes on, far away the other one holds. On a
// line the screened Poisson equation has the solution exp(-x / reach).
TEST(DiffuseOverMesh, GoesOverToAValueFarAway) {
  constexpr float kStep = 0.1f, kReach = 0.5f;
  constexpr int kSteps = 30;
  Points vertices;
  Triangles triangles;
  for (int i = 0; i <= kSteps; ++i)
    vertices.emplace_back(kStep * i, 0, 0), vertices.emplace_back(kStep * i, kStep, 0);
  for (int i = 0; i < kSteps; ++i)
    triangles.push_back({2 * i, 2 * i + 2, 2 * i + 1}),
        triangles.push_back({2 * i + 1, 2 * i + 2, 2 * i + 3});
  std::vector<bool> known(vertices.size(), false);
  std::vector<cv::Vec3f> values(vertices.size());
  known[0] = known[1] = true;
  values[0] = values[1] = {1, 1, 1};
  diffuseOverMesh(vertices, triangles, known, values,
                  FarValues{std::vector<cv::Vec3f>(vertices.size(), {0.0f, 1.0f, 0.0f}), kReach});
  EXPECT_GT(values[2][0], 0.7f);
  // The strip's rims have fewer links than the formula takes for granted: within a factor of two.
  const float at_reach = values[2 * static_cast<int>(kReach / kStep)][0];
  EXPECT_GT(at_reach, std::exp(-2.0f));
  EXPECT_LT(at_reach, std::exp(-0.5f));
  EXPECT_LT(values[2 * kSteps][0], 0.05f);
  EXPECT_NEAR(values[2 * kSteps][1], 1.0f, 1e-3f);
}

// A strip whose left third is seen, with the sky in it, and the others copied: one is darker than
// what it continues, the other has another pattern.
TEST(LevelSeams, BrightensACopyToWhatItContinuesAndLeavesHuesAndPatterns) {
  Points vertices;
  Triangles triangles;
  for (int i = 0; i <= 30; ++i) vertices.emplace_back(i, 0, 0), vertices.emplace_back(i, 1, 0);
  for (int i = 0; i < 30; ++i)
    triangles.push_back({2 * i, 2 * i + 2, 2 * i + 1}),
        triangles.push_back({2 * i + 1, 2 * i + 2, 2 * i + 3});
  SurfaceTexture texture(vertices, triangles, 0.25f, 100000);
  const cv::Vec3f colours[] = {{0.09f, 0.06f, 0.5f}, {0.02f, 0.05f, 0.4f}, {0.9f, 0.9f, 0.9f}};
  std::vector<signed char> part(texture.size());
  for (int t = 0; t < texture.triangleCount(); ++t) {
    for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
      part[i] = static_cast<signed char>(t / 20);
      const cv::Vec3f c = colours[t / 20] * (i % 2 == 0 ? 1.02f : 0.98f);  // grain
      texture.texels[i] = cv::Vec4f(c[0], c[1], c[2], 0.0f);
    }
  }
  const SurfaceTexture before = texture;
  levelSeams(vertices, triangles, part, texture);
  const float brighter = luminance(colours[0]) / luminance(colours[1]);
  for (std::size_t i = 0; i < texture.size(); ++i) {
    if (part[i] != 1) {
      EXPECT_EQ(texture.texels[i], before.texels[i]) << i;
      continue;
    }
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(texture.texels[i][c] / before.texels[i][c], brighter, 0.02f) << i;
  }
}

}  // namespace
}  // namespace calipso::render

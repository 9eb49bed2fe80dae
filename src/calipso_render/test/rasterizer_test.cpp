#include "calipso_render/rasterizer.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <opencv2/core.hpp>
#include <utility>

#include "calipso_render/edge_coverage.hpp"
#include "calipso_render/shadow_map.hpp"

namespace calipso::render {
namespace {

// A triangle on the picture plane with nearness z.
ScreenMesh triangle(const Triangles& triangles, Eigen::Vector2f a, Eigen::Vector2f b,
                    Eigen::Vector2f c, float z) {
  ScreenMesh mesh;
  mesh.points = {{a.x(), a.y(), z}, {b.x(), b.y(), z}, {c.x(), c.y(), z}};
  mesh.triangles = &triangles;
  return mesh;
}

const Triangles kOne = {{0, 1, 2}};

TEST(VisibilityBuffer, NearerSurfaceWinsWhateverTheOrder) {
  for (const bool near_first : {true, false}) {
    const ScreenMesh near = triangle(kOne, {0, 0}, {19, 0}, {0, 19}, 2.0f),
                     far = triangle(kOne, {0, 0}, {19, 0}, {0, 19}, 1.0f);
    const std::vector<const ScreenMesh*> both = {near_first ? &near : &far,
                                                 near_first ? &far : &near};
    const VisibilityBuffer buffer({0, 0, 20, 20}, both);
    EXPECT_EQ(VisibilityBuffer::objectOf(buffer.idAt(3, 3)), near_first ? 0 : 1);
    EXPECT_FLOAT_EQ(buffer.nearnessAt(3, 3), 2.0f);
  }
}

TEST(VisibilityBuffer, SharedEdgesHaveNoCracks) {
  // A fan around an odd centre covers its square without a gap.
  ScreenMesh mesh;
  mesh.points = {{10.37f, 9.81f, 1}, {0, 0, 1}, {20, 0, 1}, {20, 20, 1}, {0, 20, 1}};
  const Triangles fan = {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 1}};
  mesh.triangles = &fan;
  const VisibilityBuffer buffer({0, 0, 21, 21}, {&mesh});
  for (int v = 0; v <= 20; ++v) {
    for (int u = 0; u <= 20; ++u)
      EXPECT_NE(buffer.idAt(u, v), VisibilityBuffer::kNothing) << u << ", " << v;
  }
}

TEST(VisibilityBuffer, CoversWhatTheEdgesEnclose) {
  // Against the edges' signs at every pixel, for triangles of all shapes: slivers, nearly level,
  // far beyond the picture.
  cv::RNG random(5);
  for (int k = 0; k < 300; ++k) {
    Eigen::Vector2f p[3];
    for (Eigen::Vector2f& x : p) {
      const float spread = k % 4 == 0 ? 3000.0f : 40.0f;
      x = {random.uniform(-spread, spread),
           k % 5 == 0 ? 17.3f + random.uniform(-0.01f, 0.01f) : random.uniform(-spread, spread)};
    }
    const ScreenMesh mesh = triangle(kOne, p[0], p[1], p[2], 1.0f);
    const VisibilityBuffer buffer({0, 0, 33, 29}, {&mesh});
    for (int v = 0; v < 29; ++v) {
      for (int u = 0; u < 33; ++u) {
        double least = 1e30, greatest = -1e30;  // signed distances to the edges, px
        for (int i = 0; i < 3; ++i) {
          const Eigen::Vector2d a = p[i].cast<double>(), e = p[(i + 1) % 3].cast<double>() - a,
                                x = Eigen::Vector2d(u, v) - a;
          const double distance = (e.x() * x.y() - e.y() * x.x()) / (e.norm() + 1e-12);
          least = std::min(least, distance), greatest = std::max(greatest, distance);
        }
        const bool seen = buffer.idAt(u, v) != VisibilityBuffer::kNothing;
        const bool inside = least > 0.02 || greatest < -0.02,
                   outside = least < -0.02 && greatest > 0.02;
        ASSERT_TRUE(seen || !inside) << k << ": " << u << ", " << v;
        ASSERT_FALSE(seen && outside) << k << ": " << u << ", " << v;
      }
    }
  }
}

TEST(VisibilityBuffer, SkipsWhatLiesBehindTheCamera) {
  Camera camera;
  camera.width = camera.height = 10, camera.fx = camera.fy = 10.0, camera.cx = camera.cy = 4.5;
  const Points behind = {{-1, -1, -1}, {1, -1, -1}, {0, 1, -1}};
  const ScreenMesh mesh = projectMesh(behind, kOne, camera);
  const VisibilityBuffer buffer({0, 0, 10, 10}, {&mesh});
  for (int v = 0; v < 10; ++v) {
    for (int u = 0; u < 10; ++u) EXPECT_EQ(buffer.idAt(u, v), VisibilityBuffer::kNothing);
  }
}

TEST(Barycentric, IsPerspectiveCorrect) {
  Camera camera;
  camera.width = camera.height = 100, camera.fx = camera.fy = 100.0, camera.cx = camera.cy = 50.0;
  const Points world = {{-1, -1, 3}, {2, -1, 8}, {0, 2, 5}};
  const ScreenMesh mesh = projectMesh(world, kOne, camera);
  const Eigen::Vector3f w(0.2f, 0.5f, 0.3f);
  const Eigen::Vector3f p = w[0] * world[0] + w[1] * world[1] + w[2] * world[2];
  const Eigen::Vector2d q = camera.project(p.cast<double>());
  EXPECT_LT((barycentric(mesh, 0, float(q.x()), float(q.y())) - w).norm(),
            1e-4f);  // float round-off
}

TEST(EdgeCoverage, MeasuresAreaWithinAPixel) {
  // The edge u = 10.25 covers three quarters of the pixel column 10 (from 9.5 to 10.5).
  ScreenMesh mesh;
  mesh.points = {{-5, -5, 1}, {10.25f, -5, 1}, {10.25f, 30, 1}, {-5, 30, 1}};
  const Triangles square = {{0, 1, 2}, {0, 2, 3}};
  mesh.triangles = &square;
  const VisibilityBuffer buffer({0, 0, 20, 20}, {&mesh});
  EdgeCoverage edges(buffer, buffer.region());
  edges.draw(mesh, 0);
  const EdgeCoverage::Pixel* pixel = edges.at(10, 10);
  ASSERT_NE(pixel, nullptr);
  int covered = 0;
  for (const std::uint32_t id : pixel->ids) covered += id != VisibilityBuffer::kNothing;
  EXPECT_EQ(covered, 12);
  EXPECT_EQ(edges.at(5, 10), nullptr);
}

TEST(EdgeCoverage, FindsPartsThinnerThanAPixel) {
  ScreenMesh mesh;
  mesh.points = {{10.05f, 2, 1}, {10.3f, 2, 1}, {10.3f, 18, 1}, {10.05f, 18, 1}};
  const Triangles strip = {{0, 1, 2}, {0, 2, 3}};
  mesh.triangles = &strip;
  const VisibilityBuffer buffer({0, 0, 20, 20}, {&mesh});
  ASSERT_EQ(buffer.idAt(10, 10), VisibilityBuffer::kNothing);
  EdgeCoverage edges(buffer, buffer.region());
  edges.chooseSilhouette(mesh, meshEdges(strip), buffer);
  edges.draw(mesh, 0);
  const EdgeCoverage::Pixel* pixel = edges.at(10, 10);
  ASSERT_NE(pixel, nullptr);
  int covered = 0;
  for (const std::uint32_t id : pixel->ids) covered += id != VisibilityBuffer::kNothing;
  EXPECT_EQ(covered, 4);
}

// A handle before its cup: one mesh whose front turns away by a tenth of its nearness per pixel. A
// third sheet behind both is seen by nobody.
TEST(EdgeCoverage, SmoothsWhereAMeshHidesItself) {
  ScreenMesh mesh;
  mesh.points = {{5, -5, 1.5f},   {10.3f, -5, 1},     {10.3f, 30, 1},     {5, 30, 1.5f},
                 {-5, -5, 0.5f},  {30, -5, 0.5f},     {30, 30, 0.5f},     {-5, 30, 0.5f},
                 {-5, -5, 0.25f}, {15.3f, -5, 0.25f}, {15.3f, 30, 0.25f}, {-5, 30, 0.25f}};
  const Triangles sheets = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}, {8, 9, 10}, {8, 10, 11}};
  mesh.triangles = &sheets;
  const VisibilityBuffer buffer({0, 0, 20, 20}, {&mesh});
  EdgeCoverage edges(buffer, buffer.region());
  edges.chooseSilhouette(mesh, meshEdges(sheets), buffer);
  edges.draw(mesh, 0);
  edges.settle(buffer);
  const EdgeCoverage::Pixel* pixel = edges.at(10, 10);
  ASSERT_NE(pixel, nullptr);
  int front = 0;
  for (const float nearness : pixel->nearness) front += nearness > 0.75f;
  EXPECT_EQ(front, 12);
  EXPECT_EQ(edges.at(15, 10), nullptr);
}

// A horizontal 2 m square at height 1 over the origin.
const Points kRoof = {{-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}};
const Triangles kRoofFaces = {{0, 1, 2}, {0, 2, 3}};

TEST(ShadowMap, FullShadeFullLightAndHalfAtTheEdge) {
  const ShadowMap map({{&kRoof, &kRoofFaces}}, Eigen::Vector3d::UnitZ(), {400, 0.05, 32});
  const Eigen::Vector3f up = Eigen::Vector3f::UnitZ();
  EXPECT_FLOAT_EQ(map.visibility({0, 0, 0}, up), 0.0f);
  EXPECT_FLOAT_EQ(map.visibility({2, 0, 0}, up), 1.0f);
  EXPECT_FLOAT_EQ(map.visibility({0, 0, 2}, up), 1.0f);    // above the roof
  EXPECT_NEAR(map.visibility({1, 0, 0}, up), 0.5f, 0.1f);  // half of the disc, by symmetry
}

TEST(ShadowMap, PenumbraGrowsWithTheBlockersHeight) {
  const ShadowMap map({{&kRoof, &kRoofFaces}}, Eigen::Vector3d::UnitZ(), {400, 0.1, 32});
  const Eigen::Vector3f up = Eigen::Vector3f::UnitZ();
  EXPECT_GT(map.visibility({0.95f, 0, 0}, up), 0.05f);  // 0.1 m wide half penumbra at the ground
  EXPECT_FLOAT_EQ(map.visibility({0.95f, 0, 0.9f}, up), 0.0f);  // 0.01 m just below the roof
}

// Where the map says at once that all of a disc is lit or shaded, every place in it is.
TEST(ShadowMap, UniformDiscsAreUniform) {
  const ShadowMap map({{&kRoof, &kRoofFaces}}, Eigen::Vector3d(0.3, -0.2, 1.0), {200, 0.1, 16});
  const Eigen::Vector3f up = Eigen::Vector3f::UnitZ();
  int told = 0;
  for (float x = -3.0f; x <= 3.0f; x += 0.13f) {
    for (float y = -3.0f; y <= 3.0f; y += 0.17f) {
      const std::optional<float> uniform = map.uniform({x, y, 0.0f}, up, 0.1f);
      if (!uniform) continue;
      ++told;
      for (const auto& [dx, dy] :
           {std::pair(0.0f, 0.0f), {0.1f, 0.0f}, {-0.1f, 0.0f}, {0.0f, 0.1f}, {0.0f, -0.1f}}) {
        ASSERT_EQ(map.visibility({x + dx, y + dy, 0.0f}, up), *uniform) << x << ", " << y;
      }
    }
  }
  EXPECT_GT(told, 1000);  // of 1692
}

TEST(ShadowMap, WithoutOccludersNothingIsShaded) {
  EXPECT_FLOAT_EQ(
      ShadowMap({}, Eigen::Vector3d::UnitZ(), {}).visibility({0, 0, 0}, Eigen::Vector3f::UnitZ()),
      1.0f);
}

}  // namespace
}  // namespace calipso::render

#include "texture/texture_patches.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "calipso_render/colour.hpp"
#include "texture/surface_chart.hpp"

namespace calipso::render {
namespace {

struct Mesh {
  Points vertices;
  Triangles triangles;
};

// n x n squares of a map from the unit square to space, two triangles each.
template <typename Map>
void addSheet(Mesh& mesh, int n, Map map) {
  const int first = static_cast<int>(mesh.vertices.size());
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i)
      mesh.vertices.push_back(map(static_cast<float>(i) / n, static_cast<float>(j) / n));
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const int a = first + j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
      mesh.triangles.push_back({a, b, d});
      mesh.triangles.push_back({a, d, c});
    }
  }
}

// A unit cube of six sheets with vertices of their own.
Mesh cube(int n) {
  Mesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {0.0f, 1.0f}) {
      addSheet(mesh, n, [&](float s, float t) {
        Eigen::Vector3f p;
        p[axis] = side, p[(axis + 1) % 3] = side > 0.5f ? s : t,
        p[(axis + 2) % 3] = side > 0.5f ? t : s;
        return p;
      });
    }
  }
  return mesh;
}

Mesh quarterOfACylinder() {
  Mesh mesh;
  addSheet(mesh, 12, [](float s, float t) {
    const float angle = 0.5f * static_cast<float>(M_PI) * s;
    return Eigen::Vector3f(std::cos(angle), std::sin(angle), t);
  });
  return mesh;
}

float area(const std::array<Eigen::Vector2f, 3>& c) {
  const Eigen::Vector2f a = c[1] - c[0], b = c[2] - c[0];
  return 0.5f * (a.x() * b.y() - a.y() * b.x());
}

TEST(SurfaceChart, ADevelopableSurfaceKeepsItsLengths) {
  const Mesh m = quarterOfACylinder();
  const std::vector<FlatTriangle> chart =
      SurfaceUnfolder(m.vertices, m.triangles).around(130, {0, 0, -1}, 10.0f);
  ASSERT_EQ(chart.size(), m.triangles.size());
  for (const FlatTriangle& t : chart) {
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3i& v = m.triangles[t.triangle];
      EXPECT_NEAR((t.corners[(k + 1) % 3] - t.corners[k]).norm(),
                  (m.vertices[v[(k + 1) % 3]] - m.vertices[v[k]]).norm(), 1e-4f);
    }
    EXPECT_GT(area(t.corners), 0.0f);
  }
}

// A side of a cube is a cross with its four neighbours; what would overlap is left out.
TEST(SurfaceChart, ACubeUnfoldsAcrossItsEdges) {
  const Mesh m = cube(8);
  const float radius = 0.8f;
  const std::vector<FlatTriangle> chart =
      SurfaceUnfolder(m.vertices, m.triangles).around(72, {0, 0, -1}, radius);
  float sum = 0.0f;
  for (const FlatTriangle& t : chart) sum += area(t.corners);
  EXPECT_GT(sum, 1.3f);
  EXPECT_LT(sum, static_cast<float>(M_PI) * radius * radius);
}

TEST(SurfaceChart, DownStaysDown) {
  const Mesh m = quarterOfACylinder();
  const SurfaceUnfolder unfolder(m.vertices, m.triangles);
  const auto unfolded = unfolder.around(100, {0, 0, -1}, 10.0f);
  EXPECT_GT(unfolded.size(), 1u);
  for (const FlatTriangle& t : unfolded) {
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        const Eigen::Vector3i& v = m.triangles[t.triangle];
        EXPECT_NEAR((t.corners[a] - t.corners[b]).y(), m.vertices[v[b]].z() - m.vertices[v[a]].z(),
                    1e-4f);
      }
    }
  }
}

TEST(SurfaceChart, ATriangleWithoutAreaIsNoSeed) {
  const Points vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  EXPECT_TRUE(SurfaceUnfolder(vertices, {{0, 1, 2}}).around(0, {0, 0, -1}, 1.0f).empty());
}

constexpr float kDark = 0.1f, kBright = 0.5f;

// A cube whose pattern is known on all sides but the one at x = 1.
struct Patterned {
  Mesh mesh;
  SurfaceTexture texture{mesh.vertices, mesh.triangles, 0.012f, 300000};
  std::vector<float> certain = std::vector<float>(texture.size(), 1.0f);

  explicit Patterned(bool pattern, Mesh m = cube(10)) : mesh(std::move(m)) {
    for (int t = 0; t < texture.triangleCount(); ++t) {
      for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
        const Eigen::Vector3f w = texture.weightsOf(t, i - texture.firstOf(t));
        Eigen::Vector3f p = Eigen::Vector3f::Zero();
        for (int k = 0; k < 3; ++k) p += w[k] * mesh.vertices[mesh.triangles[t][k]];
        const bool odd = (static_cast<int>(p.x() * 7.99f) + static_cast<int>(p.y() * 7.99f) +
                          static_cast<int>(p.z() * 7.99f)) %
                             2 !=
                         0;
        const float value = !pattern ? 0.3f : odd ? kDark : kBright;
        texture.texels[i] = cv::Vec4f(value, value, value, 1.0f);
        if (unknown(t)) certain[i] = 0.0f, texture.texels[i] = cv::Vec4f();
      }
    }
  }
  bool unknown(int t) const {
    return mesh.vertices[mesh.triangles[t].minCoeff()].x() > 0.99f &&
           mesh.vertices[mesh.triangles[t].maxCoeff()].x() > 0.99f;
  }
  void fill() { continuePattern(mesh.vertices, mesh.triangles, {0, 0, -1}, certain, texture); }
};

TEST(TexturePatches, AnUnseenSideShowsThePatternOfTheOthers) {
  Patterned cube(true);
  cube.fill();
  int dark = 0, bright = 0, all = 0;
  for (int t = 0; t < cube.texture.triangleCount(); ++t) {
    for (std::size_t i = cube.texture.firstOf(t);
         cube.unknown(t) && i < cube.texture.firstOf(t + 1); ++i, ++all) {
      EXPECT_EQ(cube.certain[i], 1.0f);
      const float value = cube.texture.texels[i][1];
      dark += std::abs(value - kDark) < 0.05f, bright += std::abs(value - kBright) < 0.1f;
    }
  }
  ASSERT_GT(all, 1000);
  EXPECT_GT(dark, 0.3f * all);
  EXPECT_GT(bright, 0.3f * all);
  EXPECT_GT(dark + bright, 0.75f * all);  // the rest lies on borders of the pattern
}

// Red discs in the pattern, one on each side, are not repeated on the one that nothing shows.
TEST(TexturePatches, ASingleMotifIsNotRepeated) {
  Patterned cube(true);
  const cv::Vec4f red(0.02f, 0.02f, 0.5f, 1.0f);
  for (int t = 0; t < cube.texture.triangleCount(); ++t) {
    for (std::size_t i = cube.texture.firstOf(t); i < cube.texture.firstOf(t + 1); ++i) {
      const Eigen::Vector3f w = cube.texture.weightsOf(t, i - cube.texture.firstOf(t));
      Eigen::Vector3f p = Eigen::Vector3f::Constant(-0.5f);
      for (int k = 0; k < 3; ++k) p += w[k] * cube.mesh.vertices[cube.mesh.triangles[t][k]];
      if (!cube.unknown(t) && p.norm() < 0.54f) cube.texture.texels[i] = red;
    }
  }
  cube.fill();
  int found = 0;
  for (int t = 0; t < cube.texture.triangleCount(); ++t) {
    for (std::size_t i = cube.texture.firstOf(t);
         cube.unknown(t) && i < cube.texture.firstOf(t + 1); ++i)
      found += cube.texture.texels[i][2] > 2.0f * cube.texture.texels[i][1];
  }
  EXPECT_EQ(found, 0);
}

TEST(TexturePatches, WhatIsKnownStays) {
  Patterned cube(true);
  const std::vector<cv::Vec4f> before = cube.texture.texels;
  cube.fill();
  for (int t = 0; t < cube.texture.triangleCount(); ++t) {
    for (std::size_t i = cube.texture.firstOf(t);
         !cube.unknown(t) && i < cube.texture.firstOf(t + 1); ++i)
      ASSERT_EQ(cube.texture.texels[i], before[i]);
  }
}

TEST(TexturePatches, ASurfaceWithoutAPatternIsLeftAsItIs) {
  Patterned cube(false);
  const std::vector<cv::Vec4f> before = cube.texture.texels;
  cube.fill();
  EXPECT_EQ(cube.texture.texels, before);
}

// A strip beside the cube, of another colour and known at its one end.
TEST(TexturePatches, AnotherPartOfTheMeshDoesNotTakeThePattern) {
  Mesh mesh = cube(10);
  const int first = static_cast<int>(mesh.triangles.size());
  addSheet(mesh, 8, [](float s, float t) { return Eigen::Vector3f(2.0f + 0.2f * s, 0.0f, t); });
  Patterned both(true, mesh);
  const std::size_t start = both.texture.firstOf(first),
                    middle =
                        both.texture.firstOf(first + (both.texture.triangleCount() - first) / 2);
  std::fill(both.certain.begin() + start, both.certain.begin() + middle, 1.0f);
  std::fill(both.texture.texels.begin() + start, both.texture.texels.begin() + middle,
            cv::Vec4f(0.3f, 0.2f, 0.1f, 1.0f));
  both.fill();
  for (std::size_t i = middle; i < both.texture.size(); ++i) ASSERT_EQ(both.certain[i], 0.0f);
  EXPECT_EQ(*std::min_element(both.certain.begin(), both.certain.begin() + start), 1.0f);
}

TEST(TexturePatches, NothingKnownFillsNothing) {
  Patterned cube(true);
  std::fill(cube.certain.begin(), cube.certain.end(), 0.0f);
  cube.fill();
  EXPECT_EQ(*std::max_element(cube.certain.begin(), cube.certain.end()), 0.0f);
}

}  // namespace
}  // namespace calipso::render

#include "texture/texture_unseen.hpp"

#include <gtest/gtest.h>

#include <set>

#include "render_test_scene.hpp"
#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const cv::Vec4f kRed(0.05f, 0.05f, 0.5f, 0.0f), kBlue(0.5f, 0.05f, 0.05f, 0.0f);

// A small ball beside a large one, not attached to it.
Surface twoBalls() {
  ObjectModel model = ballAt(Eigen::Vector3d::Zero());
  const TriangleMesh one = ball(12);
  const Eigen::Index vertices = one.vertices.rows(), triangles = one.triangles.rows();
  model.mesh.vertices.resize(2 * vertices, 3), model.mesh.triangles.resize(2 * triangles, 3);
  model.mesh.vertices.topRows(vertices) = 0.5 * one.vertices;
  model.mesh.vertices.bottomRows(vertices) =
      one.vertices.rowwise() + Eigen::RowVector3d(2.0 * kBallRadius, 0.0, 0.0);
  model.mesh.triangles.topRows(triangles) = one.triangles;
  model.mesh.triangles.bottomRows(triangles) = one.triangles.array() + static_cast<int>(vertices);
  return makeSurface(model);
}

// Of two shells of one mesh the upper halves are seen. The lower ones go on as their own shell
// does, not as most of the object.
TEST(FillUnseen, PartsGoOverToTheirOwnColour) {
  const Surface surface = twoBalls();
  SurfaceTexture texture(surface.key_vertices, surface.triangles, 0.01f, 100000);
  std::vector<float> certain(texture.size(), 0.0f);
  const auto isSmall = [&](int t) {
    return surface.key_vertices[surface.triangles[t][0]].x() < 0.6f * kBallRadius;
  };
  const auto heightOf = [&](int t) { return surface.key_vertices[surface.triangles[t][0]].z(); };
  for (int t = 0; t < texture.triangleCount(); ++t) {
    for (std::size_t i = texture.firstOf(t); heightOf(t) > 0.0f && i < texture.firstOf(t + 1); ++i)
      texture.texels[i] = isSmall(t) ? kRed : kBlue, certain[i] = 1.0f;
  }
  fillUnseen(surface, smoothParts(surface.key_vertices, surface.triangles),
             connectedParts(surface.key_vertices, surface.triangles),
             FaintColours(surface.triangles.size()), certain, texture);
  int lowest = 0;
  for (int t = 0; t < texture.triangleCount(); ++t) {
    if (heightOf(t) > -0.4f * kBallRadius) continue;
    const cv::Vec4f &expected = isSmall(t) ? kRed : kBlue, &c = texture.texels[texture.firstOf(t)];
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(c[k], expected[k], 0.02f);
    ++lowest;
  }
  EXPECT_GT(lowest, 100);
}

// Of the small shell its rim alone is seen: what that shows is more like it than the large one is.
TEST(FillUnseen, PartsGoOverToWhatIsFaintlySeenOfThem) {
  const Surface surface = twoBalls();
  SurfaceTexture texture(surface.key_vertices, surface.triangles, 0.01f, 100000);
  const std::vector<int> shells = connectedParts(surface.key_vertices, surface.triangles);
  std::vector<float> certain(texture.size(), 0.0f);
  FaintColours faint(surface.triangles.size());
  const auto isSmall = [&](int t) {
    return surface.key_vertices[surface.triangles[t][0]].x() < 0.6f * kBallRadius;
  };
  for (int t = 0; t < texture.triangleCount(); ++t) {
    faint[shells[t]] = isSmall(t) ? cv::Vec3f(0.1f, 0.3f, 0.2f) : cv::Vec3f(1, 1, 1);
    for (std::size_t i = texture.firstOf(t); !isSmall(t) && i < texture.firstOf(t + 1); ++i)
      texture.texels[i] = kBlue, certain[i] = 1.0f;
  }
  fillUnseen(surface, smoothParts(surface.key_vertices, surface.triangles), shells, faint, certain,
             texture);
  for (int t = 0; t < texture.triangleCount(); ++t) {
    const cv::Vec4f &expected = isSmall(t) ? cv::Vec4f(0.1f, 0.3f, 0.2f, 0.0f) : kBlue,
                    &c = texture.texels[texture.firstOf(t)];
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(c[k], expected[k], 0.02f) << t;
  }
}

// Nothing is seen at all: a middle grey.
TEST(FillUnseen, OfNothingIsGrey) {
  const Surface surface = makeSurface(ballAt(Eigen::Vector3d::Zero()));
  SurfaceTexture texture(surface.key_vertices, surface.triangles, 0.02f, 100000);
  fillUnseen(surface, smoothParts(surface.key_vertices, surface.triangles),
             connectedParts(surface.key_vertices, surface.triangles),
             FaintColours(surface.triangles.size()), std::vector<float>(texture.size(), 0.0f),
             texture);
  for (const cv::Vec4f& c : texture.texels) EXPECT_NEAR(c[1], 0.3f, 1e-4f);
}

TEST(SmoothParts, EndAtCreases) {
  const Points corners = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                          {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  const Triangles sides = {{0, 2, 1}, {0, 3, 2}, {4, 5, 6}, {4, 6, 7}, {0, 1, 5}, {0, 5, 4},
                           {1, 2, 6}, {1, 6, 5}, {2, 3, 7}, {2, 7, 6}, {3, 0, 4}, {3, 4, 7}};
  const std::vector<int> parts = smoothParts(corners, sides);
  EXPECT_EQ(std::set<int>(parts.begin(), parts.end()).size(), 6u);
  for (std::size_t t = 0; t < sides.size(); t += 2) EXPECT_EQ(parts[t], parts[t + 1]);
  const Surface round = makeSurface(ballAt(Eigen::Vector3d::Zero()));
  const std::vector<int> one = smoothParts(round.key_vertices, round.triangles);
  std::set<int> of_ball;  // without the poles' triangles, some of which have no area
  for (std::size_t t = 0; t < one.size(); ++t) {
    if (std::abs(round.key_vertices[round.triangles[t][0]].z()) < 0.9f * kBallRadius)
      of_ball.insert(one[t]);
  }
  EXPECT_EQ(of_ball.size(), 1u);
}

}  // namespace
}  // namespace calipso::render

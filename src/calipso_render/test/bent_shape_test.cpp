#include "texture/bent_shape.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "calipso_render/appearance.hpp"
#include "render_test_scene.hpp"
#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kPlace(0.0, 0.1, 0.12);

// An upright body of revolution, and what it is bent to: its top leans over.
TriangleMesh upright() {
  TriangleMesh mesh = ball();
  mesh.vertices.leftCols(2) *= 0.6;
  return mesh;
}

Eigen::Vector3d bent(const Eigen::Vector3d& x) {
  const double up = x.z() + kBallRadius;
  return x + Eigen::Vector3d(7.0 * up * up, 0.0, 0.0);
}

ObjectModel bentModel() {
  ObjectModel model = ballAt(kPlace);
  model.stock = model.mesh = upright();
  for (int i = 0; i < model.mesh.vertexCount(); ++i)
    model.mesh.vertices.row(i) = bent(model.mesh.vertex(i)).transpose();
  return model;
}

TEST(BentShape, TakesPlacesOfTheSurfaceAlong) {
  const TriangleMesh stock = upright();
  Points from, to;
  for (int i = 0; i < stock.vertexCount(); ++i) {
    from.push_back(stock.vertex(i).cast<float>());
    to.push_back(bent(stock.vertex(i)).cast<float>());
  }
  const Surface surface = makeSurface(bentModel());
  const std::vector<int> parts = connectedParts(from, surface.triangles);
  const BentShape shape(from, to, surface.triangles, parts);
  for (const Eigen::Vector3i& t : surface.triangles) {
    if ((from[t[1]] - from[t[0]]).cross(from[t[2]] - from[t[0]]).norm() < 1e-7f) continue;
    const Eigen::Vector3f middle = (from[t[0]] + from[t[1]] + from[t[2]]) / 3.0f;
    const auto there = shape({middle, middle.normalized(), parts.front()});
    ASSERT_TRUE(there);
    // The triangles' maps differ by what the surface bends within one of them.
    EXPECT_LT((there->point - bent(middle.cast<double>()).cast<float>()).norm(), 5e-4f);
    EXPECT_NEAR(there->normal.norm(), 1.0f, 1e-5f);
  }
  EXPECT_FALSE(shape({{0.0f, 0.0f, 0.0f}, Eigen::Vector3f::UnitZ(), parts.front()}));
  EXPECT_FALSE(shape({from[50], Eigen::Vector3f::UnitZ(), parts.front() + 1}));
}

// Rings, narrower than what is not seen.
cv::Vec3f ringAt(const Eigen::Vector3f& on_stock) {
  const int ring = static_cast<int>(std::floor(on_stock.z() / 0.02f + 100.5f));
  return ring % 2 == 0 ? cv::Vec3f(0.6f, 0.1f, 0.1f) : cv::Vec3f(0.1f, 0.1f, 0.6f);
}

// What was bent is the same all around where its stock model is.
TEST(Appearance, LikePlacesAreThoseOfTheStockModel) {
  const ObjectModel model = bentModel();
  const Surface surface = makeSurface(model);
  Light light;
  light.ambient[0] = {0.8f, 0.8f, 0.8f};
  const auto stockAt = [&](int t, const Eigen::Vector3f& w) -> Eigen::Vector3f {
    const Eigen::Vector3i& c = surface.triangles[t];
    const auto x = [&](int k) -> Eigen::Vector3f { return model.stock.vertex(c[k]).cast<float>(); };
    return w[0] * x(0) + w[1] * x(1) + w[2] * x(2);
  };
  View view{cv::Mat(kHeight, kWidth, CV_32FC3, cv::Scalar::all(90.0)),
            cv::Mat::zeros(kHeight, kWidth, CV_8U),
            camera(),
            {makeActor(surface, surface.key_vertices, camera())}};
  forEachPixelOf(view.actors[0], [&](int u, int v, const SurfacePoint& p) {
    const cv::Vec3f colour = ringAt(stockAt(p.triangle, p.weights));
    for (int c = 0; c < 3; ++c)
      view.picture.at<cv::Vec3f>(v, u)[c] = codeFromLinear(0.8f * colour[c]);
    view.labels.at<std::uint8_t>(v, u) = kBallLabel;
  });
  const Appearance a = makeAppearances({view}, {false}, light, {Gloss()}).front();
  int texels = 0, wrong = 0;
  for (int t = 0; t < a.texture.triangleCount(); ++t) {
    for (std::size_t i = a.texture.firstOf(t); i < a.texture.firstOf(t + 1); ++i) {
      const Eigen::Vector3f place = stockAt(t, a.texture.weightsOf(t, i - a.texture.firstOf(t)));
      const float in_ring = place.z() / 0.02f + 100.5f;
      const bool at_border = std::abs(in_ring - std::round(in_ring)) < 0.25f;
      if (place.y() < 0.02f || std::abs(place.z()) > 0.05f || at_border) continue;
      const cv::Vec4f& texel = a.texture.texels[i];
      ++texels;
      if (cv::norm(cv::Vec3f(texel[0], texel[1], texel[2]) - ringAt(place)) > 0.3) ++wrong;
    }
  }
  ASSERT_GT(texels, 500);
  EXPECT_LT(wrong, texels / 20);
}

}  // namespace
}  // namespace calipso::render

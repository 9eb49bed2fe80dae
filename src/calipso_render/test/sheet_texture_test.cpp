#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "calipso_render/appearance.hpp"
#include "calipso_render/colour.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kPlace(0.0, 0.1, 0.12);

// A closed sheet of 0.2 x 0.2, bent, that faces the camera; its front first.
constexpr int kCells = 10, kSide = (kCells + 1) * (kCells + 1);
constexpr double kSheet = 0.2, kThickness = 0.001;

// Columns: to the right, up, towards the camera.
Eigen::Matrix3d sheetAxes() {
  Eigen::Matrix3d axes;
  axes.col(2) = (camera().world_from_camera.translation() - kPlace).normalized();
  axes.col(0) = Eigen::Vector3d::UnitZ().cross(axes.col(2)).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

ObjectModel sheetModel() {
  ObjectModel model = ballAt(kPlace);
  TriangleMesh& mesh = model.mesh;
  mesh.vertices.resize(2 * kSide, 3);
  for (int i = 0; i < 2 * kSide; ++i) {
    const int cell = i % kSide;
    const double x = static_cast<double>(cell % (kCells + 1)) / kCells,
                 y = static_cast<double>(cell / (kCells + 1)) / kCells;
    const Eigen::Vector3d place(kSheet * (x - 0.5), kSheet * (y - 0.5),
                                0.04 * x * x + 0.02 * x * y + (i < kSide ? kThickness : 0.0));
    mesh.vertices.row(i) = sheetAxes() * place;
  }
  std::vector<Eigen::Vector3i> triangles;
  const auto quad = [&](int a, int b, int c, int d) {
    triangles.emplace_back(a, b, c), triangles.emplace_back(a, c, d);
  };
  const auto at = [](int column, int row) { return row * (kCells + 1) + column; };
  for (const int side : {0, kSide}) {
    for (int row = 0; row < kCells; ++row) {
      for (int column = 0; column < kCells; ++column) {
        const int a = side + at(column, row), b = side + at(column + 1, row),
                  c = side + at(column + 1, row + 1), d = side + at(column, row + 1);
        side == 0 ? quad(a, b, c, d) : quad(a, d, c, b);
      }
    }
  }
  const auto rim = [&](int a, int b) { quad(b, a, a + kSide, b + kSide); };
  for (int i = 0; i < kCells; ++i) {
    rim(at(i, 0), at(i + 1, 0)), rim(at(i + 1, kCells), at(i, kCells));
    rim(at(kCells, i), at(kCells, i + 1)), rim(at(0, i + 1), at(0, i));
  }
  mesh.triangles.resize(static_cast<int>(triangles.size()), 3);
  for (std::size_t i = 0; i < triangles.size(); ++i) mesh.triangles.row(i) = triangles[i];
  return model;
}

// How far a place of the sheet is to the right of its left edge and above its lower one, 0..1.
Eigen::Vector2d onSheet(const Eigen::Vector3f& place) {
  const Eigen::Vector3d from = sheetAxes().transpose() * (place.cast<double>() - kPlace);
  return from.head<2>() / kSheet + Eigen::Vector2d(0.5, 0.5);
}

// Neither mirrored nor turned like itself.
cv::Vec3f sheetColour(const Eigen::Vector2d& at) {
  if (at.x() < 0.35) return {0.6f, 0.1f, 0.1f};
  return at.y() < 0.3 ? cv::Vec3f(0.1f, 0.6f, 0.1f) : cv::Vec3f(0.1f, 0.1f, 0.6f);
}

// What a cloth shows on one side is woven or dyed through it.
TEST(Appearance, ASheetIsTheSameOnItsOtherSide) {
  const Surface surface = makeSurface(sheetModel());
  Light light;
  light.ambient[0] = {0.8f, 0.8f, 0.8f};
  const ClipFrame frame = frameWithBall(ballAt(kPlace));
  View view{cv::Mat(frame.bgr.size(), CV_32FC3, cv::Scalar::all(90.0)),
            cv::Mat::zeros(frame.bgr.size(), CV_8U),
            frame.camera,
            {makeActor(surface, surface.key_vertices, frame.camera)}};
  forEachPixelOf(view.actors[0], [&](int u, int v, const SurfacePoint& p) {
    const cv::Vec3f colour = sheetColour(onSheet(p.position));
    for (int c = 0; c < 3; ++c)
      view.picture.at<cv::Vec3f>(v, u)[c] = codeFromLinear(0.8f * colour[c]);
    view.labels.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(surface.index);
  });
  const Appearance a = makeAppearances({view}, {false}, light, {Gloss()}).front();
  int texels = 0, wrong = 0;
  for (int t = 2 * kCells * kCells; t < 4 * kCells * kCells; ++t) {
    for (std::size_t i = a.texture.firstOf(t); i < a.texture.firstOf(t + 1); ++i) {
      const Eigen::Vector3f w = a.texture.weightsOf(t, i - a.texture.firstOf(t));
      const Eigen::Vector3i& corners = surface.triangles[t];
      const Points& x = surface.key_vertices;
      const Eigen::Vector2d at =
          onSheet(w[0] * x[corners[0]] + w[1] * x[corners[1]] + w[2] * x[corners[2]]);
      if ((at - Eigen::Vector2d(0.5, 0.5)).cwiseAbs().maxCoeff() > 0.4 ||
          std::abs(at.x() - 0.35) < 0.05 || std::abs(at.y() - 0.3) < 0.05)
        continue;
      const cv::Vec4f& texel = a.texture.texels[i];
      ++texels;
      if (cv::norm(cv::Vec3f(texel[0], texel[1], texel[2]) - sheetColour(at)) > 0.2) ++wrong;
    }
  }
  ASSERT_GT(texels, 500);
  EXPECT_LT(wrong, texels / 50);
}

}  // namespace
}  // namespace calipso::render

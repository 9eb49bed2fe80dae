#include "calipso_align/silhouette.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "calipso_align/contour_term.hpp"
#include "synthetic_shape.hpp"

namespace calipso::align {
namespace {

struct Frame : test::PlateWithHole {
  Frame() : PlateWithHole(0.5) {}
};

TEST(Silhouette, DepthOfAPlateIsItsDistance) {
  const Frame frame;
  const DepthRendering rendering = renderDepth(frame.x, frame.triangles, test::frontCamera());
  EXPECT_NEAR(rendering.at(159 - 80, 119), 2.0f, 1e-5f);
  EXPECT_EQ(rendering.at(159, 119), 0.0f);  // through the hole
  EXPECT_EQ(rendering.at(5, 5), 0.0f);
}

TEST(Silhouette, CoversTheAreaOfThePolygon) {
  const Frame frame;
  const Camera camera = test::frontCamera();
  const int area = cv::countNonZero(maskOf(renderDepth(frame.x, frame.triangles, camera), camera));
  // 250 x 250 px minus 100 x 100 px; the height is cut to the picture's 240.
  EXPECT_NEAR(area, 250 * 240 - 100 * 100, 2 * 250);
}

TEST(Silhouette, OutlineHasTheHoleAndPointsOutwards) {
  const Frame frame;
  const Camera camera = test::frontCamera();
  const MeshTopology topology(frame.triangles);
  const auto outline = occludingContour(frame.x, topology,
                                        renderDepth(frame.x, frame.triangles, camera), camera, 2.0);
  int hole = 0;
  for (const OutlinePoint& p : outline) {
    const Eigen::Vector2d from_centre = p.pixel - Eigen::Vector2d(camera.cx, camera.cy);
    const bool inner = from_centre.lpNorm<Eigen::Infinity>() < 60.0;
    hole += inner;
    EXPECT_GT((inner ? -1.0 : 1.0) * p.normal.dot(from_centre), 0.0);
  }
  EXPECT_GT(hole, 100);
  EXPECT_GT(static_cast<int>(outline.size()) - hole, 200);
}

TEST(Silhouette, PartsBehindTheCameraAreLeftOut) {
  Frame frame;
  frame.x.col(2).setConstant(-1.0);
  EXPECT_TRUE(renderDepth(frame.x, frame.triangles, test::frontCamera()).roi.empty());
}

// Two pears, one behind the other, as one mesh.
TriangleMesh twoPears(bool second_inside_out) {
  const TriangleMesh pear = test::pear();
  const int vertices = pear.vertexCount(), faces = static_cast<int>(pear.triangles.rows());
  TriangleMesh two;
  two.vertices.resize(2 * vertices, 3);
  two.vertices << pear.vertices, pear.vertices.rowwise() + Eigen::RowVector3d(0.2, 0.5, 0.1);
  two.triangles.resize(2 * faces, 3);
  two.triangles << pear.triangles, pear.triangles.array() + vertices;
  if (second_inside_out)
    two.triangles.bottomRows(faces).col(1).swap(two.triangles.bottomRows(faces).col(2));
  return two;
}

// Back faces of closed shells are never the nearest: the picture is the same without them.
TEST(Silhouette, ClosedShellsLookTheSameWithoutTheirBackFaces) {
  const Camera camera = test::frontCamera();
  for (const bool inside_out : {false, true}) {
    const TriangleMesh mesh = twoPears(inside_out);
    const MeshTopology topology(mesh.triangles);
    ASSERT_EQ(topology.shells().size(), static_cast<size_t>(mesh.triangles.rows()));
    EXPECT_EQ(topology.shells().front(), 0);
    EXPECT_EQ(topology.shells().back(), 1);
    const Points x = test::inCamera(camera, Eigen::Isometry3d::Identity(), mesh.vertices);
    const DepthRendering all = renderDepth(x, mesh.triangles, camera),
                         front = renderDepth(x, topology, camera);
    ASSERT_EQ(all.roi, front.roi);
    // A pixel whose centre lies on the outline may go either way.
    EXPECT_LE(cv::countNonZero(cv::abs(all.depth - front.depth) > 1e-5), 2);
  }
}

TEST(Silhouette, AnOpenMeshShowsItsInside) {
  const Camera camera = test::frontCamera();
  TriangleMesh mesh = test::pear();
  const int faces = static_cast<int>(mesh.triangles.rows());
  mesh.triangles.conservativeResize(faces / 2, 3);
  const MeshTopology topology(mesh.triangles);
  for (const int shell : topology.shells()) EXPECT_EQ(shell, MeshTopology::kOpen);
  const Points x = test::inCamera(camera, Eigen::Isometry3d::Identity(), mesh.vertices);
  EXPECT_EQ(cv::norm(renderDepth(x, mesh.triangles, camera).depth,
                     renderDepth(x, topology, camera).depth, cv::NORM_INF),
            0.0);
}

TEST(ContourTerm, ResidualDerivativesMatchDifferences) {
  const TriangleMesh mesh = test::pear();
  const Camera camera = test::frontCamera();
  const MeshTopology topology(mesh.triangles);
  const Points x = test::inCamera(camera, test::roughPose(), mesh.vertices);
  const ContourTarget target =
      makeContourTarget(test::contourOf(mesh, Eigen::Isometry3d::Identity(), camera), 3.0);
  const auto outline =
      occludingContour(x, topology, renderDepth(x, mesh.triangles, camera), camera, 3.0);
  ContourTermOptions options;
  options.tangential = 0.0;
  const Rows rows = contourRows(target, outline, camera, options);
  ASSERT_GT(rows.size(), 50u);

  // Moving both ends of the edge by d changes the residual by g.d, to first order.
  const Eigen::Vector3d d = 1e-6 * Eigen::Vector3d(0.3, -0.5, 0.8);
  for (size_t k = 0; k < rows.size(); k += 7) {
    const PointRow& row = rows[k];
    const Eigen::Vector3d p = row.a[0] * x.row(row.v[0]) + row.a[1] * x.row(row.v[1]);
    const Eigen::Vector2d change = camera.project(p + d) - camera.project(p);
    const Eigen::Vector2d normal =
        (camera.projectJacobian(p) * camera.projectJacobian(p).transpose()).inverse() *
        (camera.projectJacobian(p) * row.g);
    EXPECT_NEAR(row.g.dot(d), normal.dot(change), 1e-8);
  }
}

TEST(ContourTerm, NothingPullsWhereTheModelIsTheTruth) {
  const TriangleMesh mesh = test::pear();
  const Camera camera = test::frontCamera();
  const MeshTopology topology(mesh.triangles);
  const Points x = test::inCamera(camera, Eigen::Isometry3d::Identity(), mesh.vertices);
  const ContourTarget target =
      makeContourTarget(test::contourOf(mesh, Eigen::Isometry3d::Identity(), camera), 3.0);
  const auto outline =
      occludingContour(x, topology, renderDepth(x, mesh.triangles, camera), camera, 1.0);
  double worst = 0.0;
  for (const double r : contourResiduals(target, outline)) {
    if (std::isfinite(r)) worst = std::max(worst, std::abs(r));
  }
  EXPECT_LT(worst, 1.5);  // the traced contour runs along pixel cracks, the outline does not
}

TEST(ContourTarget, SmoothingTakesNoiseOutAndKeepsTheCircle) {
  ContourLoop circle;
  constexpr int kPoints = 4000;
  constexpr double kRadius = 80.0, kNoise = 3.0;
  unsigned state = 1;
  const auto uniform = [&] {  // deviation 1, mean 0
    state = 1664525u * state + 1013904223u;
    return (state / 4294967296.0 - 0.5) * std::sqrt(12.0);
  };
  for (int i = 0; i < kPoints; ++i) {
    const double a = 2.0 * M_PI * i / kPoints;
    circle.points.emplace_back(100.0 + kRadius * std::cos(a) + kNoise * uniform(),
                               100.0 + kRadius * std::sin(a) + kNoise * uniform());
  }
  circle.known.assign(kPoints, true);
  circle.confidence.assign(kPoints, 1.0f);
  const ContourTarget target = makeContourTarget({circle}, 4.0);
  EXPECT_NEAR(target.noise_px, kNoise, 0.15 * kNoise);
  EXPECT_NEAR(target.length_px, 2.0 * M_PI * kRadius, 0.05 * 2.0 * M_PI * kRadius);
  double mean = 0.0, square = 0.0;
  for (const TargetPoint& p : target.points) {
    const double error = (p.pixel - Eigen::Vector2d(100.0, 100.0)).norm() - kRadius;
    mean += error / target.points.size();
    square += error * error / target.points.size();
  }
  EXPECT_LT(std::abs(mean), 0.15);  // it does not shrink
  EXPECT_LT(std::sqrt(square), 0.3 * kNoise);
}

TEST(ContourTarget, RejectsLoopsThatAreNone) {
  EXPECT_THROW(makeContourTarget({}, 2.0), std::invalid_argument);
  ContourLoop few;
  few.points.assign(3, Eigen::Vector2d::Zero());
  few.known.assign(3, true);
  few.confidence.assign(3, 1.0f);
  try {
    makeContourTarget({few}, 2.0);
    FAIL() << "three points make no contour";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("loop 0 has 3 points"), std::string::npos);
  }
}

}  // namespace
}  // namespace calipso::align

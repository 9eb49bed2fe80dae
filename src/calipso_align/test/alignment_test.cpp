#include "calipso_align/alignment.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "calipso_align/metrics.hpp"
#include "synthetic_shape.hpp"

namespace calipso::align {
namespace {

AlignOptions coarse() {
  AlignOptions options;
  options.levels = {200};
  return options;
}

// The pear, bent and stretched across the sight line.
TriangleMesh deformedPear() {
  TriangleMesh mesh = test::pear();
  for (int i = 0; i < mesh.vertexCount(); ++i) {
    const double z = mesh.vertices(i, 2);
    mesh.vertices(i, 0) = 1.15 * mesh.vertices(i, 0) + 0.2 * z * z;
  }
  return mesh;
}

std::string reasonOf(const TriangleMesh& mesh, const Eigen::Isometry3d& rough) {
  const Camera camera = test::frontCamera();
  const AlignmentResult result = align(
      mesh, camera, rough,
      test::contourOf(test::pear(), Eigen::Isometry3d::Identity(), camera), coarse());
  EXPECT_FALSE(result.trusted);
  return result.reason;
}

TEST(Alignment, FindsAModelThatOnlyHasToBeMoved) {
  const Camera camera = test::frontCamera();
  const TriangleMesh mesh = test::pear();
  const Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();
  const AlignmentResult result =
      align(mesh, camera, test::roughPose(), test::contourOf(mesh, truth, camera), coarse());
  EXPECT_TRUE(result.trusted) << result.reason;
  EXPECT_LT(result.contour_mean_px, 0.5);  // the contour itself runs along pixel cracks
  EXPECT_EQ(result.mesh.triangles, mesh.triangles);
  EXPECT_NEAR(result.scale, 1.0, 0.05);
}

TEST(Alignment, FollowsABentContour) {
  const Camera camera = test::frontCamera();
  const Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();
  const std::vector<ContourLoop> contour = test::contourOf(deformedPear(), truth, camera);
  const AlignmentResult result =
      align(test::pear(), camera, test::roughPose(), contour, coarse());
  EXPECT_TRUE(result.trusted) << result.reason;
  const Points x = test::inCamera(camera, result.world_from_object, result.mesh.vertices);
  EXPECT_LT(contourError(contour, x, MeshTopology(result.mesh.triangles), camera).mean_px, 0.7);
}

TEST(Alignment, DepthImageFixesTheDistance) {
  const Camera camera = test::frontCamera();
  const TriangleMesh mesh = test::pear();
  const Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();
  const Points true_x = test::inCamera(camera, truth, mesh.vertices);
  const DepthRendering rendering = renderDepth(true_x, mesh.triangles, camera);
  cv::Mat1f depth = cv::Mat1f::zeros(camera.height, camera.width);
  rendering.depth.copyTo(depth(rendering.roi));
  AlignOptions options = coarse();
  options.depth = DepthObservation{depth};
  Eigen::Isometry3d rough = test::roughPose();
  rough.translation().y() += 0.15;  // a twentieth of the distance
  const AlignmentResult result =
      align(mesh, camera, rough, test::contourOf(mesh, truth, camera), options);
  const Points x = test::inCamera(camera, result.world_from_object, result.mesh.vertices);
  EXPECT_NEAR(x.col(2).mean(), true_x.col(2).mean(), 0.02);
}

TEST(Alignment, DoesNotGoThroughTheTable) {
  const Camera camera = test::frontCamera();
  const TriangleMesh mesh = test::pear();
  AlignOptions options = coarse();
  options.planes.push_back({"table", Eigen::Vector3d::UnitZ(), -0.5, std::nullopt});
  const AlignmentResult result =
      align(mesh, camera, test::roughPose(),
            test::contourOf(mesh, Eigen::Isometry3d::Identity(), camera), options);
  const Points world = transformed(result.world_from_object, result.mesh.vertices);
  EXPECT_GT(world.col(2).minCoeff(), -0.5 - 0.01);
}

TEST(Alignment, SameInputGivesTheSameBytes) {
  const Camera camera = test::frontCamera();
  const std::vector<ContourLoop> contour =
      test::contourOf(test::pear(), Eigen::Isometry3d::Identity(), camera);
  const AlignmentResult a = align(test::pear(), camera, test::roughPose(), contour, coarse());
  const AlignmentResult b = align(test::pear(), camera, test::roughPose(), contour, coarse());
  EXPECT_EQ(a.mesh.vertices, b.mesh.vertices);
  EXPECT_EQ(a.world_from_object.matrix(), b.world_from_object.matrix());
}

TEST(Alignment, FlagsAPoseBehindTheCamera) {
  Eigen::Isometry3d rough = Eigen::Isometry3d::Identity();
  rough.translation().y() = -6.0;
  EXPECT_NE(reasonOf(test::pear(), rough).find("behind the camera"), std::string::npos);
}

TEST(Alignment, FlagsAPoseOffTheImage) {
  Eigen::Isometry3d rough = Eigen::Isometry3d::Identity();
  rough.translation().x() = 8.0;
  EXPECT_NE(reasonOf(test::pear(), rough).find("off the image"), std::string::npos);
}

TEST(Alignment, FlagsAModelInMillimetres) {
  TriangleMesh mesh = test::pear();
  mesh.vertices *= 1000.0;
  EXPECT_NE(reasonOf(mesh, Eigen::Isometry3d::Identity()).find("size implausible"),
            std::string::npos);
}

TEST(Alignment, RejectsATriangleWithoutVertex) {
  TriangleMesh mesh = test::pear();
  mesh.triangles(0, 0) = 99999;
  const Camera camera = test::frontCamera();
  EXPECT_THROW(align(mesh, camera, Eigen::Isometry3d::Identity(),
                     test::contourOf(test::pear(), Eigen::Isometry3d::Identity(), camera)),
               std::invalid_argument);
}

}  // namespace
}  // namespace calipso::align

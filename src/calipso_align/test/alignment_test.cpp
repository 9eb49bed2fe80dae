#include "calipso_align/alignment.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <numeric>
#include <opencv2/imgproc.hpp>

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
  const AlignmentResult result =
      align(mesh, camera, rough,
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

// What a depth camera at the picture's place sees.
DepthObservation depthOf(const TriangleMesh& truth, const Camera& camera) {
  const DepthRendering rendering =
      renderDepth(test::inCamera(camera, Eigen::Isometry3d::Identity(), truth.vertices),
                  truth.triangles, camera);
  cv::Mat1f depth = cv::Mat1f::zeros(camera.height, camera.width);
  rendering.depth.copyTo(depth(rendering.roi));
  return {depth};
}

TEST(Alignment, FollowsABentContour) {
  const Camera camera = test::frontCamera();
  const Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();
  const std::vector<ContourLoop> contour = test::contourOf(deformedPear(), truth, camera);
  for (const bool with_depth : {false, true}) {
    AlignOptions options = coarse();
    if (with_depth) options.depth = depthOf(deformedPear(), camera);
    const AlignmentResult result = align(test::pear(), camera, test::roughPose(), contour, options);
    // Three times its size away, the twentieth of the distance that a placement may be off is 13 %
    // of the size: only what shows the distance makes a model that deforms one to be trusted.
    EXPECT_EQ(result.trusted, with_depth) << result.reason;
    if (!with_depth) {
      EXPECT_NE(result.reason.find("depth undetermined"), std::string::npos) << result.reason;
    }
    const Points x = test::inCamera(camera, result.world_from_object, result.mesh.vertices);
    EXPECT_LT(contourError(contour, x, MeshTopology(result.mesh.triangles), camera).mean_px, 0.7);
  }
}

// No quadratic map comes near a snake: pairs of nearest points lead its bends astray until it is
// close.
TEST(Alignment, ComesCloserToAContourThatIsFarOff) {
  const Camera camera = test::frontCamera();
  TriangleMesh snake = test::pear();
  for (int i = 0; i < snake.vertexCount(); ++i)
    snake.vertices(i, 0) = 0.5 * snake.vertices(i, 0) + 0.25 * std::sin(4.0 * snake.vertices(i, 2));
  const std::vector<ContourLoop> contour =
      test::contourOf(snake, Eigen::Isometry3d::Identity(), camera);
  const AlignmentResult result = align(test::pear(), camera, test::roughPose(), contour, coarse());
  const Points x = test::inCamera(camera, result.world_from_object, result.mesh.vertices);
  EXPECT_LT(contourError(contour, x, MeshTopology(result.mesh.triangles), camera).mean_px, 0.7);
}

// However coarse the mesh is, and whichever way it is wound.
TEST(Alignment, DepthImageFixesTheDistance) {
  const Camera camera = test::frontCamera();
  const Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();
  for (const TriangleMesh& mesh :
       {test::pear(), test::box({0.25, 0.2, 0.3}), test::frontInsideOut(test::pear())}) {
    const Points true_x = test::inCamera(camera, truth, mesh.vertices);
    AlignOptions options = coarse();
    options.depth = depthOf(mesh, camera);
    for (const double off : {-0.15, 0.15}) {  // a twentieth of the distance
      Eigen::Isometry3d rough = test::roughPose();
      rough.translation().y() += off;
      const AlignmentResult result =
          align(mesh, camera, rough, test::contourOf(mesh, truth, camera), options);
      const Points x = test::inCamera(camera, result.world_from_object, result.mesh.vertices);
      EXPECT_NEAR(x.col(2).mean(), true_x.col(2).mean(), 0.02) << mesh.triangleCount();
    }
  }
}

TEST(Alignment, SaysHowUncertainTheDistanceIs) {
  const Camera camera = test::frontCamera();
  const TriangleMesh truth = deformedPear();
  const Eigen::Isometry3d identity = Eigen::Isometry3d::Identity();
  const std::vector<ContourLoop> contour = test::contourOf(truth, identity, camera);
  const double distance = test::inCamera(camera, identity, truth.vertices).colwise().mean().norm();
  for (const bool with_depth : {false, true}) {
    AlignOptions options = coarse();
    if (with_depth) options.depth = depthOf(truth, camera);
    for (const double off : {-0.05, 0.0, 0.05}) {
      Eigen::Isometry3d rough = test::roughPose();
      rough.translation().y() += off * distance;
      const AlignmentResult result = align(test::pear(), camera, rough, contour, options);
      const Points x = test::inCamera(camera, result.world_from_object, result.mesh.vertices);
      const double error = x.colwise().mean().norm() / distance - 1.0;
      EXPECT_LT(std::abs(error), 3.0 * result.distance_sigma) << off << " " << with_depth;
      // A placement that is at most a twentieth off is the least that is known.
      EXPECT_LT(result.distance_sigma, with_depth ? 0.01 : 0.05);
      if (!with_depth) {
        EXPECT_GT(result.distance_sigma, 0.02);
      }
    }
  }
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

// What is seen of a mesh in water of this height, by a level camera.
struct Afloat {
  DepthObservation depth;
  std::vector<ContourLoop> contour;
  Afloat(const TriangleMesh& mesh, double water, const Camera& camera)
      : depth(depthOf(mesh, camera)) {
    cv::Mat1b mask = cv::Mat1b::zeros(depth.depth.size());
    for (int v = 0; v < mask.rows; ++v) {
      const double below = (v - camera.cy) / camera.fy;  // of a ray of depth 1
      const float surface = below > 0.0 ? static_cast<float>(-water / below) : 0.0f;
      for (int u = 0; u < mask.cols; ++u) {
        float& d = depth.depth(v, u);
        if (d > 0.0f && !(surface > 0.0f && surface < d)) {
          mask(v, u) = 1;
        } else {
          d = surface;
        }
      }
    }
    contour = traceLoops(mask, 1, {});
  }
};

// Pressed to the water line the mesh meets the contour less well. (A soft one would meet it as well:
// then it is taken to stand.)
TEST(Alignment, LeavesInTheWaterWhatGoesOnBelowIt) {
  constexpr double kWater = -0.35, kStiff = 100.0;
  const Camera camera = test::frontCamera();
  TriangleMesh mesh = test::pear(40, 24);
  for (int i = 0; i < mesh.vertexCount(); ++i)
    mesh.vertices.row(i).head<2>() *= 1.0 + 0.2 * std::sin(25.0 * mesh.vertices(i, 2));
  const Afloat seen(mesh, kWater, camera);
  AlignOptions options = coarse();
  options.elastic_weight = kStiff;
  options.depth = seen.depth;
  options.planes.push_back({"water", Eigen::Vector3d::UnitZ(), kWater, std::nullopt});
  Eigen::Isometry3d rough = test::roughPose();
  rough.translation().z() += 0.1;
  const AlignmentResult result = align(mesh, camera, rough, seen.contour, options);
  const Points world = transformed(result.world_from_object, result.mesh.vertices);
  EXPECT_NEAR(world.col(2).minCoeff(), mesh.vertices.col(2).minCoeff(), 0.01);
  EXPECT_LT(result.contour_mean_px, 0.3);
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
  EXPECT_NE(reasonOf(test::pear(), rough).find("in millimetres"), std::string::npos)
      << "a model whose origin lies far off is easily thrown there by its unit";
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

TEST(Alignment, OffersTheScaleOfAModelInMillimetres) {
  TriangleMesh mesh = test::pear();
  mesh.vertices *= 1000.0;
  // A model a thousand times too large, around the camera: said with the factor that mends it.
  Eigen::Isometry3d rough = Eigen::Isometry3d::Identity();
  const std::string reason = reasonOf(mesh, rough);
  const size_t at = reason.find("scaled by ");
  ASSERT_NE(at, std::string::npos) << reason;
  EXPECT_NEAR(std::stod(reason.substr(at + 10)), 1e-3, 3e-4);
}

// The contour of the pear's silhouette after a change of its mask.
std::vector<ContourLoop> contourOfMask(const std::function<void(cv::Mat1b&)>& change,
                                       const TriangleMesh& mesh = test::pear()) {
  const Camera camera = test::frontCamera();
  const Points x = test::inCamera(camera, Eigen::Isometry3d::Identity(), mesh.vertices);
  cv::Mat1b mask = maskOf(renderDepth(x, mesh.triangles, camera), camera);
  change(mask);
  return traceLoops(mask / 255, 1, {});
}

TEST(Alignment, FlagsAContourOfTwoPieces) {
  const std::vector<ContourLoop> contour =
      contourOfMask([](cv::Mat1b& mask) { mask.rowRange(105, 135).setTo(0); });
  ASSERT_EQ(contour.size(), 2u);
  const AlignmentResult result =
      align(test::pear(), test::frontCamera(), test::roughPose(), contour, coarse());
  EXPECT_FALSE(result.trusted);
  EXPECT_NE(result.reason.find("separate pieces"), std::string::npos) << result.reason;
}

// The pear with a round window through it, along the sight line.
TriangleMesh pearWithWindow(double radius) {
  const TriangleMesh whole = test::pear(60, 80);
  std::vector<Eigen::RowVector3i> faces;
  for (int f = 0; f < whole.triangleCount(); ++f) {
    Eigen::RowVector3d middle = Eigen::RowVector3d::Zero();
    for (int k = 0; k < 3; ++k) middle += whole.vertices.row(whole.triangles(f, k)) / 3.0;
    if (std::hypot(middle.x() - 0.05, middle.z() + 0.15) > radius)
      faces.push_back(whole.triangles.row(f));
  }
  TriangleMesh mesh = whole;
  mesh.triangles.resize(static_cast<int>(faces.size()), 3);
  for (size_t f = 0; f < faces.size(); ++f) mesh.triangles.row(static_cast<int>(f)) = faces[f];
  return mesh;
}

TEST(Alignment, FlagsAHoleThatOnlyTheModelHas) {
  const Camera camera = test::frontCamera();
  const auto aligned = [&](const TriangleMesh& model, const TriangleMesh& truth) {
    AlignOptions options = coarse();
    options.depth = depthOf(truth, camera);
    return align(model, camera, test::roughPose(),
                 test::contourOf(truth, Eigen::Isometry3d::Identity(), camera), options);
  };
  const AlignmentResult same = aligned(pearWithWindow(0.08), pearWithWindow(0.08));
  EXPECT_TRUE(same.trusted) << same.reason;
  const AlignmentResult closed = aligned(pearWithWindow(0.08), test::pear(60, 80));
  EXPECT_FALSE(closed.trusted);
  // A window of 13 px radius; less where turned and filled up by the wall behind.
  const size_t at = closed.reason.find("the model shows a hole of ");
  ASSERT_NE(at, std::string::npos) << closed.reason;
  EXPECT_NEAR(std::stod(closed.reason.substr(at + 26)), M_PI * 13.0 * 13.0, 150.0);
}

TEST(Alignment, FlagsAHoleThatOnlyThePictureHas) {
  // 1.1 % of the area: too little for what protrudes, and too short for what is not met.
  const std::vector<ContourLoop> contour = contourOfMask([](cv::Mat1b& mask) {
    cv::circle(mask, {165, 140}, 6, cv::Scalar(0), cv::FILLED);
  });
  ASSERT_EQ(contour.size(), 2u);
  const AlignmentResult result =
      align(test::pear(), test::frontCamera(), test::roughPose(), contour, coarse());
  EXPECT_FALSE(result.trusted);
  EXPECT_NE(result.reason.find("the picture shows a hole of "), std::string::npos) << result.reason;
}

TEST(Alignment, AnOccludersHoleIsNoneThatTheModelLacks) {
  const cv::Point at(165, 140);
  const auto hide = [&](cv::Mat& picture, double value) {
    cv::circle(picture, at, 8, cv::Scalar(value), cv::FILLED);
  };
  const std::vector<ContourLoop> contour = contourOfMask([&](cv::Mat1b& mask) { hide(mask, 0.0); });
  AlignOptions options = coarse();
  options.depth = depthOf(test::pear(), test::frontCamera());
  hide(options.depth->depth, 2.0);  // a ball in front
  const AlignmentResult result =
      align(test::pear(), test::frontCamera(), test::roughPose(), contour, options);
  EXPECT_TRUE(result.trusted) << result.reason;
}

TEST(Alignment, FlagsAMaskThatFillsTheImage) {
  const std::vector<ContourLoop> contour = contourOfMask([](cv::Mat1b& mask) { mask.setTo(255); });
  const AlignmentResult result =
      align(test::pear(), test::frontCamera(), test::roughPose(), contour, coarse());
  EXPECT_FALSE(result.trusted);
  EXPECT_NE(result.reason.find("contour mostly unknown"), std::string::npos) << result.reason;
}

TEST(Alignment, RejectsAnEmptyContour) {
  try {
    align(test::pear(), test::frontCamera(), test::roughPose(), {}, coarse());
    FAIL() << "nothing was thrown";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("segment the object first"), std::string::npos);
  }
}

TEST(Alignment, SaysThatTheImageBorderCutsTheObject) {
  // The camera looks past the pear, so that a third of it is outside of the picture.
  Camera camera = test::frontCamera();
  camera.cx = 20.0;
  const TriangleMesh mesh = test::pear();
  const std::vector<ContourLoop> contour =
      test::contourOf(mesh, Eigen::Isometry3d::Identity(), camera);
  const AlignmentResult result = align(mesh, camera, test::roughPose(), contour, coarse());
  EXPECT_NE(result.reason.find("cut by the image border"), std::string::npos) << result.reason;
  const Points x = test::inCamera(camera, result.world_from_object, result.mesh.vertices);
  EXPECT_LT(contourError(contour, x, MeshTopology(mesh.triangles), camera).mean_px, 0.7);
}

TEST(Alignment, ExpectsALargerErrorWhereNothingShowsTheDepth) {
  const Camera camera = test::frontCamera();
  const TriangleMesh truth = deformedPear();
  const Eigen::Isometry3d identity = Eigen::Isometry3d::Identity();
  const std::vector<ContourLoop> contour = test::contourOf(truth, identity, camera);
  const AlignmentResult blind = align(test::pear(), camera, test::roughPose(), contour, coarse());
  AlignOptions options = coarse();
  options.depth = depthOf(truth, camera);
  const AlignmentResult seen = align(test::pear(), camera, test::roughPose(), contour, options);
  EXPECT_LT(seen.expected_error, 0.5 * blind.expected_error);
}

TEST(Alignment, LiteralMethodComesCloseToASmallDeformation) {
  AlignOptions options = coarse();
  options.method = Method::kLiteral;
  const Camera camera = test::frontCamera();
  const std::vector<ContourLoop> contour =
      test::contourOf(test::pear(), Eigen::Isometry3d::Identity(), camera);
  const AlignmentResult result = align(test::pear(), camera, test::roughPose(), contour, options);
  const Points x = test::inCamera(camera, result.world_from_object, result.mesh.vertices);
  // Its constraint asks for 4 px.
  EXPECT_LT(contourError(contour, x, MeshTopology(result.mesh.triangles), camera).mean_px, 4.0);
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

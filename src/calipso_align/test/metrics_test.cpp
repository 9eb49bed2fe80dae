#include "calipso_align/metrics.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "synthetic_shape.hpp"

namespace calipso::align {
namespace {

// Outlines are sampled every quarter of a pixel.
constexpr double kSampling = 0.15;

// Plate 200 px wide, hole 100.
struct Plate : test::PlateWithHole {
  Plate() : PlateWithHole(0.4) {}
};

// A square about the picture's middle, a point every pixel.
ContourLoop square(double half, bool hole) {
  const Camera camera = test::frontCamera();
  ContourLoop loop;
  loop.hole = hole;
  for (const double turn : {0.0, 0.5, 1.0, 1.5}) {
    const Eigen::Rotation2Dd rotation(M_PI * turn);
    for (double s = half; s > -half; s -= 1.0)
      loop.points.push_back(Eigen::Vector2d(camera.cx, camera.cy) +
                            rotation * Eigen::Vector2d(s, half));
  }
  loop.confidence.assign(loop.points.size(), 1.0f);
  loop.known.assign(loop.points.size(), true);
  return loop;
}

const std::vector<ContourLoop> kTrue = {square(100, false), square(50, true)};

ContourError contourErrorOf(const std::vector<ContourLoop>& contour, const Plate& plate) {
  return contourError(contour, plate.x, MeshTopology(plate.triangles), test::frontCamera());
}

ContourError hullErrorOf(const std::vector<ContourLoop>& contour, const Plate& plate) {
  return hullError(contour, plate.x, MeshTopology(plate.triangles), test::frontCamera());
}

TEST(ContourError, IsNoneForTheModelsOwnContour) {
  EXPECT_LT(contourErrorOf(kTrue, Plate()).p95_px, kSampling);
  EXPECT_LT(hullErrorOf(kTrue, Plate()).p95_px, kSampling);
}

TEST(ContourError, OfAHoleThatThePictureDoesNotHaveIsItsWidthAndTheHullHasNone) {
  const std::vector<ContourLoop> without = {kTrue[0]};
  // That of 400 of the outline's 1200 px; the contour's 800 px are met.
  EXPECT_NEAR(contourErrorOf(without, Plate()).p95_px, 50.0, 0.5);
  EXPECT_NEAR(contourErrorOf(without, Plate()).mean_px, 50.0 * 400.0 / 2000.0, 0.2);
  EXPECT_LT(hullErrorOf(without, Plate()).p95_px, kSampling);
}

// Across two of four sides.
TEST(ContourError, OfAShiftIsSeenAcrossTheOutline) {
  Plate shifted;
  shifted.x.col(0).array() += 3.0 * 2.0 / test::frontCamera().fx;
  const ContourError error = hullErrorOf(kTrue, shifted);
  EXPECT_NEAR(error.mean_px, 1.5, kSampling);
  EXPECT_NEAR(error.p95_px, 3.0, kSampling);
}

TEST(ContourError, DoesNotCountWhatIsUnknown) {
  Plate shifted;
  shifted.x.col(0).array() += 3.0 * 2.0 / test::frontCamera().fx;
  std::vector<ContourLoop> contour = {kTrue[0]};
  for (size_t i = 0; i < contour[0].points.size(); ++i) {
    const double across = std::abs(contour[0].points[i].x() - test::frontCamera().cx);
    contour[0].known[i] = across < 95.0;
  }
  EXPECT_LT(hullErrorOf(contour, shifted).p95_px, kSampling);
}

TEST(SurfaceError, OfParallelPlatesIsTheirDistance) {
  const Plate near;
  Plate far;
  far.x.col(2).array() += 0.1;
  const SurfaceError error = surfaceError(near.x, far.x, near.triangles, far.triangles);
  EXPECT_NEAR(error.mean, 0.1, 1e-12);
  EXPECT_NEAR(error.rms, 0.1, 1e-12);
  EXPECT_NEAR(error.hausdorff, 0.1, 1e-12);
}

// One of eight vertices stands off, on one of the two surfaces.
TEST(SurfaceError, CountsBothWays) {
  const Plate plate;
  Plate dented;
  dented.x(0, 2) += 0.3;
  const SurfaceError error = surfaceError(plate.x, dented.x, plate.triangles, dented.triangles),
                     swapped = surfaceError(dented.x, plate.x, dented.triangles, plate.triangles);
  EXPECT_NEAR(error.hausdorff, 0.3, 1e-12);
  EXPECT_GT(error.mean, 0.5 * 0.3 / 8.0);
  EXPECT_LT(error.mean, error.rms);
  EXPECT_DOUBLE_EQ(error.mean, swapped.mean);
}

TEST(ReprojectionError, IsThatOfTheGivenVerticesInFrontOfTheCamera) {
  const Plate truth;
  Plate off;
  off.x(0, 0) += 0.02;  // 5 px
  off.x.row(1) << 0.0, 0.0, -1.0;
  EXPECT_NEAR(reprojectionError(off.x, truth.x, test::frontCamera(), {0, 1, 2}), 2.5, 1e-9);
  EXPECT_TRUE(std::isnan(reprojectionError(off.x, truth.x, test::frontCamera(), {1})));
}

TEST(DepthGauge, BringsTheModelToTheTruthsDepth) {
  const Plate truth;
  EXPECT_DOUBLE_EQ(depthGauge(2.0 * truth.x, truth.x), 0.5);
}

TEST(IntersectionOverUnion, CountsPixels) {
  const cv::Mat1b a = (cv::Mat1b(1, 3) << 1, 1, 0), b = (cv::Mat1b(1, 3) << 0, 1, 1);
  EXPECT_DOUBLE_EQ(intersectionOverUnion(a, b), 1.0 / 3.0);
  EXPECT_DOUBLE_EQ(intersectionOverUnion(0 * a, 0 * b), 1.0);
}

}  // namespace
}  // namespace calipso::align

#include "calipso_align/relief.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_align/depth_image.hpp"
#include "calipso_align/segmentation.hpp"
#include "synthetic_picture.hpp"

namespace calipso::align {
namespace {

using testing::box;
using testing::disc;
using testing::intersectionOverUnion;
using testing::maskOf;
using testing::paint;

const cv::Size kSize(160, 120);
const cv::Vec3b kGreen(40, 160, 60), kGrey(150, 150, 150);
const testing::SignedDistance kDisc = disc(80.3, 60.7, 30.2);

// A disc 1 m away in front of a slanted wall, moved by `shift` px against its picture.
cv::Mat depthOfDisc(double shift) {
  cv::Mat depth(kSize, CV_32F);
  for (int v = 0; v < kSize.height; ++v)
    for (int u = 0; u < kSize.width; ++u)
      depth.at<float>(v, u) =
          kDisc(u - shift, v) < 0.0 ? 1.0f : 1.0f / (0.5f + 0.001f * static_cast<float>(u));
  return depth;
}

TEST(Relief, APlaneHasNoJumpAndAStepHasOne) {
  const Relief relief = makeRelief(paint(kSize, kDisc, kGreen, kGrey, 2.0), depthOfDisc(0));
  EXPECT_LT(jump(relief, {10, 60}, {1, 0}), 0.1f);    // rounding of floats
  EXPECT_GT(jump(relief, {50, 60}, {1, 0}), 100.0f);  // the disc's left edge
  EXPECT_FLOAT_EQ(jump(relief, {50, 60}, {1, 0}), jump(relief, {51, 60}, {-1, 0}));
}

TEST(Relief, RegistrationIsMeasured) {
  const cv::Mat image = paint(kSize, kDisc, kGreen, kGrey, 2.0);
  EXPECT_TRUE(makeRelief(image, depthOfDisc(0)).registered);
  const Relief shifted = makeRelief(image, depthOfDisc(6));
  EXPECT_FALSE(shifted.registered);
  EXPECT_EQ(shifted.state.at<uchar>(60, 56), Relief::kUnusable);
  EXPECT_EQ(shifted.state.at<uchar>(60, 80), Relief::kSurface);
}

// As registered depth often is: smaller than the picture, its pixels repeated.
TEST(Relief, EnlargedDepthIsTold) {
  const cv::Mat depth = depthOfDisc(0);
  for (const double factor : {1.5, 2.0, 4.0}) {
    cv::Mat small, enlarged;
    cv::resize(depth, small, {}, 1.0 / factor, 1.0 / factor, cv::INTER_NEAREST);
    cv::resize(small, enlarged, depth.size(), 0, 0, cv::INTER_NEAREST);
    EXPECT_NEAR(enlargement(enlarged), factor, 0.05 * factor) << factor;
  }
  // 848 columns as 1280: products of such fractions are not whole where they should be.
  cv::Mat1f ramp(2, 1280);
  for (int x = 0; x < ramp.cols; ++x) ramp.col(x) = static_cast<float>(x * 848 / 1280);
  cv::Mat square;
  cv::repeat(ramp, 640, 1, square);
  cv::Mat both = square + square.t();
  EXPECT_NEAR(enlargement(both), 1280.0 / 848.0, 0.01);
  EXPECT_EQ(enlargement(depth), 1.0);
  EXPECT_EQ(enlargement(cv::Mat1f(kSize, 1.0f)), 1.0) << "a wall that is faced tells nothing";
}

TEST(Relief, NoDepthIsNoRelief) {
  const cv::Mat image = paint(kSize, kDisc, kGreen, kGrey, 2.0);
  EXPECT_TRUE(makeRelief(image, cv::Mat::zeros(kSize, CV_32F)).empty());
  EXPECT_TRUE(makeRelief(image, cv::Mat()).empty());
}

TEST(SurfaceModel, SkyBelongsToTheLabelThatHasIt) {
  cv::Mat depth = depthOfDisc(0);
  depth.setTo(0.0f, maskOf(kSize, kDisc) == 0);
  const Relief relief = makeRelief(paint(kSize, kDisc, kGreen, kGrey, 2.0), depth);
  const cv::Mat own = maskOf(kSize, kDisc);
  const SurfaceModel object = SurfaceModel::fit(relief, own, {}, 0.15, 4);
  const SurfaceModel sky = SurfaceModel::fit(relief, own == 0, {}, 0.85, 4);
  EXPECT_LT(sky.cost(relief, 5, 5), object.cost(relief, 5, 5) - 5.0f);
  EXPECT_LT(object.cost(relief, 80, 60), sky.cost(relief, 80, 60) - 5.0f);
}

// As much sky as disc is taken for the disc, as the sky that a lattice encloses may be.
TEST(SurfaceModel, StrokesTellThatALabelHasNoSky) {
  cv::Mat depth = depthOfDisc(0);
  depth.setTo(0.0f, maskOf(kSize, kDisc) == 0);
  const Relief relief = makeRelief(paint(kSize, kDisc, kGreen, kGrey, 2.0), depth);
  cv::Mat own = maskOf(kSize, kDisc);
  const int area = cv::countNonZero(own);
  own(cv::Rect(0, 0, kSize.width, 20)).setTo(255);
  ASSERT_GT(cv::countNonZero(own), 1.8 * area);
  cv::Mat strokes = cv::Mat::zeros(kSize, CV_8U);
  strokes(cv::Rect(65, 55, 30, 10)).setTo(255);
  const SurfaceModel believing = SurfaceModel::fit(relief, own, {}, 0.3, 4),
                     told = SurfaceModel::fit(relief, own, strokes, 0.3, 4);
  // One pixel of 302 instead of one of two, by Laplace's rule.
  EXPECT_NEAR(told.cost(relief, 5, 5) - believing.cost(relief, 5, 5), std::log(302.0 / 2.0), 0.2);
  EXPECT_LT(told.cost(relief, 80, 60), believing.cost(relief, 80, 60));
}

TEST(SurfaceModel, StrokesWithoutUsableDepthTellNothing) {
  cv::Mat depth = depthOfDisc(0);
  depth.setTo(0.0f, maskOf(kSize, kDisc) == 0);
  Relief relief = makeRelief(paint(kSize, kDisc, kGreen, kGrey, 2.0), depth);
  const cv::Mat sky = maskOf(kSize, kDisc) == 0;
  cv::Mat strokes = cv::Mat::zeros(kSize, CV_8U);
  strokes(cv::Rect(0, 0, 30, 10)).setTo(255);
  relief.state.setTo(Relief::kUnusable, strokes);
  const SurfaceModel stroked = SurfaceModel::fit(relief, sky, strokes, 0.3, 4),
                     sampled = SurfaceModel::fit(relief, sky, {}, 0.3, 4);
  EXPECT_EQ(stroked.cost(relief, 5, 110), sampled.cost(relief, 5, 110));
  EXPECT_EQ(stroked.someCost(), sampled.someCost());
}

// A picture in which colours tell nothing of the object's right half, and depth tells everything.
TEST(Segmenter, DepthFindsWhatColoursDoNot) {
  const auto left = [](double u, double v) { return std::max(kDisc(u, v), u - 80.0); };
  const cv::Mat image = paint(kSize, left, kGreen, kGrey, 3.0);
  cv::Mat strokes = cv::Mat::zeros(kSize, CV_8U);
  strokes(cv::Rect(60, 55, 40, 8)).setTo(1);
  const std::vector<SegmentationTarget> targets = {{"disc", 1, cv::Rect(45, 25, 72, 72), {}, {}}};
  Segmenter with(image, targets, {}, depthOfDisc(0)), without(image, targets);
  const cv::Mat truth = maskOf(kSize, kDisc);
  EXPECT_GE(intersectionOverUnion(with.segment(strokes) == 1, truth), 0.98);
  EXPECT_LT(intersectionOverUnion(without.segment(strokes) == 1, truth), 0.8);
}

// A cone on a plane 1 m away, in depth of steps of 1 mm, whose shadow to its right looks as the
// cone does.
struct ConeWithShadow {
  cv::Mat image, depth = cv::Mat(kSize, CV_32F), plane = cv::Mat(kSize, CV_32F, cv::Scalar(1.0));
  cv::Mat strokes = cv::Mat::zeros(kSize, CV_8U);
  std::vector<SegmentationTarget> targets = {{"cone", 1, cv::Rect(40, 20, 90, 80), {}, {}}};

  ConeWithShadow() {
    const auto shadow = disc(82.8, 60.7, 30.2);
    const auto either = [=](double u, double v) { return std::min(kDisc(u, v), shadow(u, v)); };
    image = paint(kSize, either, kGreen, kGrey, 3.0);
    for (int v = 0; v < kSize.height; ++v)
      for (int u = 0; u < kSize.width; ++u) {
        const double inside = std::max(0.0, -kDisc(u, v) / 30.2);
        const double height = inside > 0.0 ? 0.003 + 0.1 * inside : 0.0;
        depth.at<float>(v, u) = static_cast<float>(std::round(1e3 * (1.0 - height)) / 1e3);
      }
    // A wall at the side, whose edge is where the picture has it.
    const cv::Rect wall(0, 0, 20, kSize.height);
    image(wall).setTo(cv::Scalar(20, 20, 20));
    depth(wall).setTo(0.5f);
    strokes(cv::Rect(60, 55, 40, 8)).setTo(1);
  }
};

TEST(SupportDepths, OfAFloorThatEnds) {
  Camera camera;
  camera.width = 40, camera.height = 30;
  camera.fx = camera.fy = 40.0, camera.cx = 20.0, camera.cy = 0.0;
  // Level, 2 m above the floor, looking along world y.
  camera.world_from_camera.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  camera.world_from_camera.translation() << 0, 0, 2.0;
  const cv::Mat all =
      supportDepths({{"floor", Eigen::Vector3d::UnitZ(), 0.0, std::nullopt}}, camera)[0];
  const cv::Mat half = supportDepths(
      {{"floor", Eigen::Vector3d::UnitZ(), 0.0, Eigen::Vector2d(0.0, 9.0)}}, camera)[0];
  EXPECT_FLOAT_EQ(all.at<float>(20, 20), 4.0f);  // 2 m / (20 / 40)
  EXPECT_EQ(all.at<float>(0, 20), 0.0f);         // the horizon
  EXPECT_FLOAT_EQ(half.at<float>(20, 25), 4.0f);
  EXPECT_EQ(half.at<float>(20, 15), 0.0f);
}

TEST(Relief, ASupportIsKnownToTheStepOfTheDepthImage) {
  const ConeWithShadow scene;
  const cv::Mat close = scene.plane + 0.0008, off = scene.plane + 0.003;
  cv::Mat outside = maskOf(kSize, kDisc) == 0;
  outside.colRange(0, 20).setTo(0);
  const Relief relief = makeRelief(scene.image, scene.depth, {close});
  EXPECT_EQ(cv::countNonZero(relief.on_support != outside), 0);
  EXPECT_EQ(cv::countNonZero(makeRelief(scene.image, scene.depth, {off}).on_support), 0);
  EXPECT_TRUE(makeRelief(scene.image, scene.depth).on_support.empty());
}

TEST(Segmenter, WhatLiesOnASupportIsNoObject) {
  const ConeWithShadow scene;
  Segmenter with(scene.image, scene.targets, {}, scene.depth, {scene.plane}),
      without(scene.image, scene.targets, {}, scene.depth);
  const cv::Mat truth = maskOf(kSize, kDisc);
  EXPECT_GE(intersectionOverUnion(with.segment(scene.strokes) == 1, truth), 0.99);
  EXPECT_LT(intersectionOverUnion(without.segment(scene.strokes) == 1, truth), 0.98);
}

// A cloth's own strokes lie where the plane is: it is kept all the same.
TEST(Segmenter, AnObjectThatLiesFlatIsNotItsSupport) {
  const cv::Mat image = paint(kSize, kDisc, kGreen, kGrey, 3.0),
                plane(kSize, CV_32F, cv::Scalar(1.0));
  cv::Mat depth = plane.clone(), strokes = cv::Mat::zeros(kSize, CV_8U);
  depth(cv::Rect(0, 0, 20, 120)).setTo(0.5);  // something else, for edges to be compared
  strokes(cv::Rect(60, 55, 40, 8)).setTo(1);
  Segmenter segmenter(image, {{"cloth", 1, cv::Rect(45, 25, 72, 72), {}, {}}}, {}, depth, {plane});
  EXPECT_GE(intersectionOverUnion(segmenter.segment(strokes) == 1, maskOf(kSize, kDisc)), 0.98);
}

TEST(Segmenter, DepthThatDoesNotFitThePictureDoesNoHarm) {
  const cv::Mat image = paint(kSize, kDisc, kGreen, kGrey, 3.0);
  Segmenter segmenter(image, {{"disc", 1, cv::Rect(45, 25, 72, 72), {}, {}}}, {}, depthOfDisc(6));
  EXPECT_GE(intersectionOverUnion(segmenter.segment({}) == 1, maskOf(kSize, kDisc)), 0.985);
}

TEST(Segmenter, ALineOfOnePixelIsSeenInALargePicture) {
  const cv::Size size(1280, 720);
  const auto object = box(400, 200, 700, 500);
  const cv::Mat image = paint(size, object, kGreen, kGrey, 3.0);
  cv::Mat strokes = cv::Mat::zeros(size, CV_8U);
  strokes(cv::Rect(450, 301, 200, 1)).setTo(1);
  Segmenter segmenter(image, {{"box", 1, cv::Rect(350, 150, 420, 420), {}, {}}});
  EXPECT_GE(intersectionOverUnion(segmenter.segment(strokes) == 1, maskOf(size, object)), 0.985);
}

TEST(Segmenter, NamesADepthImageOfAnotherSize) {
  const cv::Mat image = paint(kSize, kDisc, kGreen, kGrey, 3.0);
  try {
    Segmenter(image, {{"disc", 1, cv::Rect(45, 25, 72, 72), {}, {}}}, {},
              cv::Mat::ones(5, 7, CV_32F));
    FAIL() << "nothing was thrown";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("7x5"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace calipso::align

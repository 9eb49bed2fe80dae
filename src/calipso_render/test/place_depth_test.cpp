#include "place/place_depth.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/renderer.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {
namespace {

constexpr int kWide = 160, kHigh = 96;
constexpr float kWall = 4.0f, kPost = 1.0f;  // m away
const cv::Rect kObject(60, 30, 24, 24);

// Looks along +z of the world, from `right` m beside the origin.
Camera cameraAt(double right) {
  Camera c;
  c.width = kWide, c.height = kHigh, c.fx = c.fy = 150.0, c.cx = 79.5, c.cy = 47.5;
  c.world_from_camera.translation() = Eigen::Vector3d(right, 0.0, 0.0);
  return c;
}

std::uint8_t wallColour(double x, double y) {
  return cv::saturate_cast<std::uint8_t>(120.0 + 50.0 * std::sin(23.0 * x) * std::cos(17.0 * y) +
                                         40.0 * std::sin(7.0 * x + 5.0 * y));
}

// A painted wall, and before it, in every picture at another place of the wall, an object that is 1
// m away.
ClipFrame frameFrom(double right) {
  ClipFrame f{cv::Mat(kHigh, kWide, CV_8UC3), cv::Mat::zeros(kHigh, kWide, CV_8U), cameraAt(right)};
  for (int v = 0; v < kHigh; ++v) {
    for (int u = 0; u < kWide; ++u) {
      const Eigen::Vector3d p =
          kWall * f.camera.ray(u, v) + f.camera.world_from_camera.translation();
      f.bgr.at<cv::Vec3b>(v, u) = cv::Vec3b::all(wallColour(p.x(), p.y()));
    }
  }
  const cv::Rect object(kObject.x - cvRound(right * f.camera.fx / kPost), kObject.y, kObject.width,
                        kObject.height);
  cv::rectangle(f.bgr, object, cv::Scalar::all(255), cv::FILLED);
  cv::rectangle(f.labels, object, cv::Scalar(1), cv::FILLED);
  return f;
}

std::vector<ClipFrame> passingBy() {
  std::vector<ClipFrame> clip;
  for (int k = 0; k < 10; ++k) clip.push_back(frameFrom(0.04 * k));
  return clip;
}

cv::Mat depthImage() {
  cv::Mat depth(kHigh, kWide, CV_32F, cv::Scalar(kWall));
  cv::rectangle(depth, kObject, cv::Scalar(kPost), cv::FILLED);
  return depth;
}

TEST(PlaceDepth, IsThatOfTheDepthImageBesideObjectsAndInfiniteWithoutOne) {
  EXPECT_FLOAT_EQ(placeNearness(passingBy(), {}, depthImage(), 2).at<float>(5, 5), 1.0f / kWall);
  EXPECT_EQ(cv::countNonZero(placeNearness(passingBy(), {}, cv::Mat(), 2)), 0);
}

TEST(PlaceDepth, FramesThatLookBehindAnObjectTellIt) {
  std::vector<ClipFrame> clip = passingBy();
  cv::Mat depth = depthImage();
  depth.colRange(0, 20).setTo(2.0f);  // another depth that could be behind it
  const cv::Mat nearness = placeNearness(clip, {}, depth, 2);
  for (int v = kObject.y; v < kObject.br().y; ++v) {
    for (int u = kObject.x; u < kObject.br().x; ++u)
      ASSERT_FLOAT_EQ(nearness.at<float>(v, u), 1.0f / kWall) << u << ", " << v;
  }
}

// Of waves, which look otherwise in every frame, no depth is told by agreement: they go on behind
// the object, at their depth, and what stands before it does not.
TEST(PlaceDepth, WhatMovesByItselfGoesOnAsBesideTheObject) {
  std::vector<ClipFrame> clip = passingBy();
  cv::RNG random(3);
  for (ClipFrame& f : clip) {
    cv::Mat waves(f.bgr.size(), CV_8UC3);
    random.fill(waves, cv::RNG::NORMAL, 120.0, 12.0);
    waves.copyTo(f.bgr, f.labels == 0);
  }
  cv::Mat depth = depthImage();
  const cv::Rect crate(kObject.br().x, kObject.y + 12, 20, 40);
  depth(crate).setTo(0.5f);
  const cv::Mat nearness = placeNearness(clip, {}, depth, 2);
  for (int v = kObject.y; v < kObject.br().y; ++v) {
    for (int u = kObject.x; u < kObject.br().x; ++u)
      ASSERT_FLOAT_EQ(nearness.at<float>(v, u), 1.0f / kWall) << u << ", " << v;
  }
  EXPECT_FLOAT_EQ(nearness.at<float>(crate.y + 5, crate.x), 2.0f);  // the object does not hide it
}

TEST(PlaceDepth, OtherFramesComeIntoTheKeyViewByIt) {
  const ClipFrame key = frameFrom(0.0), other = frameFrom(0.3);
  const cv::Mat nearness(kHigh, kWide, CV_32F, cv::Scalar(1.0f / kWall));
  cv::Mat warped;
  cv::remap(other.bgr, warped, viewWarp(nearness, other.camera, key.camera), cv::noArray(),
            cv::INTER_LINEAR);
  const cv::Rect behind(kObject.x, kObject.y, 20, 20);
  for (int v = behind.y; v < behind.br().y; ++v) {
    for (int u = behind.x; u < behind.br().x; ++u) {
      const Eigen::Vector3d p = kWall * key.camera.ray(u, v);
      ASSERT_NEAR(warped.at<cv::Vec3b>(v, u)[0], wallColour(p.x(), p.y()),
                  6);  // what linear interpolation leaves
    }
  }
}

TEST(PlaceDepth, FromAnotherCameraANearPlaceHidesAFarOne) {
  cv::Mat nearness(kHigh, kWide, CV_32F, cv::Scalar(1.0f / kWall));
  nearness.colRange(60, 80).setTo(1.0f / kPost);
  EXPECT_LE(cv::countNonZero(nearnessFrom(nearness, cameraAt(0.0), cameraAt(0.0)) != nearness),
            kHigh);  // squares of two: a column more at most
  // 0.2 m to the right the post is seen 30 px farther left, the wall 7.5 px: beside the post the
  // wall goes on.
  const cv::Mat from = nearnessFrom(nearness, cameraAt(0.0), cameraAt(0.2));
  EXPECT_FLOAT_EQ(from.at<float>(40, 40), 1.0f / kPost);
  EXPECT_FLOAT_EQ(from.at<float>(40, 28), 1.0f / kWall);
  EXPECT_FLOAT_EQ(from.at<float>(40, 60), 1.0f / kWall);         // the post hid it
  EXPECT_FLOAT_EQ(from.at<float>(40, kWide - 1), 1.0f / kWall);  // outside the key frame
}

TEST(PlaceDepth, SaysWhatAnotherCameraDoesNotSeeForWhatStandsBefore) {
  cv::Mat nearness(kHigh, kWide, CV_32F, cv::Scalar(1.0f / kWall)),
      guessed = cv::Mat::zeros(kHigh, kWide, CV_8U);
  nearness.colRange(60, 80).setTo(1.0f / kPost);
  // 22.5 px farther left than the wall, the post hides what the key frame shows there.
  const cv::Mat hidden = hiddenFrom(nearness, guessed, cameraAt(0.0), cameraAt(0.2));
  EXPECT_EQ(cv::countNonZero(hidden.colRange(39, 58) == 0), 0);
  EXPECT_EQ(cv::countNonZero(hidden.colRange(8, 36) | hidden.colRange(82, 110)), 0);
  EXPECT_EQ(cv::countNonZero(hidden.colRange(60, 80)), 0);
  guessed.colRange(60, 80).setTo(255);
  EXPECT_EQ(cv::countNonZero(hiddenFrom(nearness, guessed, cameraAt(0.0), cameraAt(0.2))), 0);
}

// The object of frameFrom(), a square without depth.
ObjectModel square() {
  const Camera c = cameraAt(0.0);
  TriangleMesh m;
  m.vertices.resize(4, 3);
  m.triangles.resize(2, 3);
  const int right = kObject.x + kObject.width - 1, bottom = kObject.y + kObject.height - 1;
  m.vertices << c.ray(kObject.x, kObject.y).transpose(), c.ray(right, kObject.y).transpose(),
      c.ray(right, bottom).transpose(), c.ray(kObject.x, bottom).transpose();
  m.vertices *= kPost;
  m.triangles << 0, 1, 2, 0, 2, 3;
  return {"square", 1, m, Eigen::Isometry3d::Identity()};
}

TEST(Prepare, ACameraThatMovesSeesPastAnObjectAtRest) {
  ClipSample clip;
  for (const ClipFrame& f : passingBy()) clip.add(f);
  RenderParams params;
  params.depth = depthImage();
  const Prepared p = prepare(clip, {square()}, params);
  ASSERT_FALSE(p.moves.front());
  const Camera key = cameraAt(0.0);
  for (int v = kObject.y; v < kObject.br().y; ++v) {
    for (int u = kObject.x; u < kObject.br().x; ++u) {
      const Eigen::Vector3d wall = kWall * key.ray(u, v);
      ASSERT_EQ(p.background.invented.at<std::uint8_t>(v, u), 0) << u << ", " << v;
      ASSERT_NEAR(p.background.plate.at<cv::Vec3f>(v, u)[0], wallColour(wall.x(), wall.y()), 6);
    }
  }
}

}  // namespace
}  // namespace calipso::render

// What a camera that turns away sees beside the key frame's picture.

#include "place/plate_beside.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/renderer.hpp"

namespace calipso::render {
namespace {

constexpr int kWide = 160, kHigh = 96, kFrames = 10;
constexpr float kWall = 4.0f, kObject = 1.0f;  // m away
constexpr double kPace = 0.4;                  // m per frame: 15 px of the wall
const cv::Rect kSquare(60, 30, 24, 24);        // the object in every frame: the camera goes with it

// Looks along +z of the world.
Camera cameraAt(double k) {
  Camera c;
  c.width = kWide, c.height = kHigh, c.fx = c.fy = 150.0, c.cx = 79.5, c.cy = 47.5;
  c.world_from_camera.translation() = Eigen::Vector3d(kPace * k, 0.0, 0.0);
  return c;
}

uchar wallAt(double k, int u, int v) {
  const Eigen::Vector3d p = cameraAt(k).world_from_camera * (kWall * cameraAt(k).ray(u, v));
  return cv::saturate_cast<uchar>(120.0 + 50.0 * std::sin(11.0 * p.x()) * std::cos(9.0 * p.y()) +
                                  40.0 * std::sin(7.0 * p.x() + 5.0 * p.y()));
}

ClipFrame frameAt(int k, double pace = 1.0) {
  ClipFrame f{cv::Mat(kHigh, kWide, CV_8UC3), cv::Mat::zeros(kHigh, kWide, CV_8U),
              cameraAt(pace * k)};
  f.stamp_ns = 33'000'000LL * k;
  for (int v = 0; v < kHigh; ++v) {
    for (int u = 0; u < kWide; ++u)
      f.bgr.at<cv::Vec3b>(v, u) = cv::Vec3b::all(wallAt(pace * k, u, v));
  }
  f.bgr(kSquare).setTo(cv::Scalar(40, 60, 250)), f.labels(kSquare).setTo(1);
  return f;
}

std::vector<ClipFrame> clipOf(double pace) {
  std::vector<ClipFrame> frames;
  for (int k = 0; k < kFrames; ++k) frames.push_back(frameAt(k, pace));
  return frames;
}

ObjectModel square() {
  const Camera c = cameraAt(0);
  TriangleMesh m;
  m.vertices.resize(4, 3), m.triangles.resize(2, 3);
  const int right = kSquare.br().x - 1, bottom = kSquare.br().y - 1;
  m.vertices << c.ray(kSquare.x, kSquare.y).transpose(), c.ray(right, kSquare.y).transpose(),
      c.ray(right, bottom).transpose(), c.ray(kSquare.x, bottom).transpose();
  m.vertices *= kObject;
  m.triangles << 0, 1, 2, 0, 2, 3;
  return {"square", 1, m, Eigen::Isometry3d::Identity()};
}

const cv::Mat& wallNearness() {
  static const cv::Mat nearness(kHigh, kWide, CV_32F, cv::Scalar(1.0 / kWall));
  return nearness;
}

TEST(PlatesBeside, ShowWhatTheKeyFramesPictureDoesNotReach) {
  const std::vector<PlateBeside> plates = platesBeside(clipOf(1.0), wallNearness(), true, {});
  ASSERT_EQ(plates.size(), 1u);
  const double last = kFrames - 1;
  EXPECT_NEAR(plates[0].camera.world_from_camera.translation().x(), kPace * last, 1e-9);
  EXPECT_LT(plates[0].spread.at<float>(42, 72), 2.0f) << "other frames look past the object";
}

TEST(PlatesBeside, AreNoneBeforeACameraThatHardlyMoves) {
  EXPECT_TRUE(platesBeside(clipOf(0.01), wallNearness(), true, {}).empty());
}

TEST(Renderer, WhatIsTakenAwayBesideTheKeyFramesPictureShowsThePlace) {
  RenderParams params;
  params.add_noise = false;
  params.depth = cv::Mat(kHigh, kWide, CV_32F, cv::Scalar(kWall));
  params.depth(kSquare).setTo(kObject);
  ClipSample clip;
  for (const ClipFrame& f : clipOf(1.0)) clip.add(f);
  const auto prepared = std::make_shared<const Prepared>(prepare(clip, {square()}, params));
  ASSERT_TRUE(prepared->moves[0]);
  const ClipFrame last = frameAt(kFrames - 1);
  FrameInput in;
  in.bgr = last.bgr, in.labels = last.labels, in.camera = last.camera;
  ObjectInFrame object;
  object.name = "square", object.removed = true;
  in.objects = {object};
  const FrameOutput out = Renderer(prepared, params).composite(in);
  double off = 0.0;
  for (int v = kSquare.y; v < kSquare.br().y; ++v) {
    for (int u = kSquare.x; u < kSquare.br().x; ++u)
      off += std::abs(out.bgr.at<cv::Vec3b>(v, u)[0] - wallAt(kFrames - 1, u, v));
  }
  EXPECT_LT(off / kSquare.area(), 4.0) << "code values; interpolated twice";
  EXPECT_EQ(cv::countNonZero(out.provenance(kSquare) != kSeenElsewhere), 0);
}

}  // namespace
}  // namespace calipso::render

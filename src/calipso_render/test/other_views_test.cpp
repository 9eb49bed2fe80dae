// What a camera that moves shows of a painted wall, of a post before it that is edited, and of a
// crate before both.

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/renderer.hpp"
#include "calipso_render/shadow_map.hpp"
#include "place/key_cover.hpp"
#include "place/uncovered.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {
namespace {

constexpr int kWide = 200, kHigh = 100;
constexpr float kWall = 4.0f, kPost = 2.0f, kCrate = 1.0f;  // m away
constexpr int kCrateColour = 30, kPostColour = 250;
const cv::Rect kPostBox(90, 20, 12, 60), kCrateBox(100, 50, 40, 40);  // at the key frame

// Looks along +z of the world, from `right` m beside the origin.
Camera cameraAt(double right) {
  Camera c;
  c.width = kWide, c.height = kHigh, c.fx = c.fy = 150.0, c.cx = 99.5, c.cy = 49.5;
  c.world_from_camera.translation() = Eigen::Vector3d(right, 0.0, 0.0);
  return c;
}

std::uint8_t wallColour(const Camera& camera, int u, int v) {
  const Eigen::Vector3d p = kWall * camera.ray(u, v) + camera.world_from_camera.translation();
  return cv::saturate_cast<std::uint8_t>(140.0 +
                                         30.0 * std::sin(9.0 * p.x()) * std::cos(7.0 * p.y()));
}

cv::Rect seenFrom(double right, const cv::Rect& at_key, float away) {
  return {at_key.x - cvRound(right * 150.0 / away), at_key.y, at_key.width, at_key.height};
}

// @param masked rows of the post from the top that the mask has
ClipFrame frameFrom(double right, int masked = kPostBox.height) {
  ClipFrame f{cv::Mat(kHigh, kWide, CV_8UC3), cv::Mat::zeros(kHigh, kWide, CV_8U), cameraAt(right)};
  for (int v = 0; v < kHigh; ++v) {
    for (int u = 0; u < kWide; ++u)
      f.bgr.at<cv::Vec3b>(v, u) = cv::Vec3b::all(wallColour(f.camera, u, v));
  }
  const cv::Rect post = seenFrom(right, kPostBox, kPost),
                 crate = seenFrom(right, kCrateBox, kCrate);
  f.bgr(post).setTo(cv::Scalar::all(kPostColour));
  f.labels(cv::Rect(post.x, post.y, post.width, masked)).setTo(1);
  f.bgr(crate).setTo(cv::Scalar::all(kCrateColour)), f.labels(crate).setTo(0);
  f.stamp_ns = cvRound(1e6 * right);
  return f;
}

ObjectModel post() {
  const Camera c = cameraAt(0.0);
  const int right = kPostBox.br().x - 1, bottom = kPostBox.br().y - 1;
  TriangleMesh m;
  m.vertices.resize(4, 3);
  m.triangles.resize(2, 3);
  m.vertices << c.ray(kPostBox.x, kPostBox.y).transpose(), c.ray(right, kPostBox.y).transpose(),
      c.ray(right, bottom).transpose(), c.ray(kPostBox.x, bottom).transpose();
  m.vertices *= kPost;
  m.triangles << 0, 1, 2, 0, 2, 3;
  return {"post", 1, m, Eigen::Isometry3d::Identity()};
}

RenderParams params() {
  RenderParams p;
  p.depth = cv::Mat(kHigh, kWide, CV_32F, cv::Scalar(kWall));
  p.depth(kPostBox).setTo(kPost), p.depth(kCrateBox).setTo(kCrate);
  p.add_noise = false;
  return p;
}

std::vector<double> ways() { return {0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4}; }

// @param masked of the frames but the first
std::shared_ptr<const Prepared> prepared(int masked) {
  ClipSample clip;
  for (const double right : ways()) {
    clip.add(frameFrom(right, right > 0.0 ? masked : kPostBox.height));
    clip.setPoses(clip.frames().size() - 1, {{1, post().world_from_object}});
  }
  return std::make_shared<const Prepared>(prepare(clip, {post()}, params()));
}

FrameInput input(const ClipFrame& frame, float move_right, bool removed) {
  FrameInput in{frame.bgr, frame.labels, frame.camera, frame.stamp_ns, {}, {}};
  ObjectInFrame o;
  o.name = "post", o.edited = true, o.removed = removed;
  const ObjectModel model = post();
  for (int i = 0; i < model.mesh.vertexCount(); ++i)
    o.vertices.push_back(model.mesh.vertex(i).cast<float>() +
                         Eigen::Vector3f(move_right, 0.0f, 0.0f));
  in.objects.push_back(o);
  return in;
}

// Masks of further frames have its upper half alone: it rests, as the poses say, and its model tells
// the rest.
TEST(OtherViews, WhatMasksMissOfAnObjectAtRestGoesWithIt) {
  const auto p = prepared(kPostBox.height / 2);
  ASSERT_FALSE(p->moves.front());
  const double right = 0.2;
  const ClipFrame frame = frameFrom(right, kPostBox.height / 2);
  const cv::Mat out = Renderer(p, params()).composite(input(frame, 0.0f, true)).bgr;
  const cv::Rect box = seenFrom(right, kPostBox, kPost), crate = seenFrom(right, kCrateBox, kCrate);
  for (int v = box.y; v < box.br().y; ++v) {
    for (int u = box.x; u < box.br().x; ++u) {
      const int expected = crate.contains({u, v}) ? kCrateColour : wallColour(frame.camera, u, v);
      ASSERT_NEAR(out.at<cv::Vec3b>(v, u)[0], expected, 16) << u << ", " << v;
    }
  }
}

TEST(OtherViews, WhatStandsBeforeAnEditedObjectHidesIt) {
  const auto p = prepared(kPostBox.height);
  const double right = 0.2;
  const ClipFrame frame = frameFrom(right);
  const float move = 0.15f;  // m: behind the crate
  const cv::Mat out = Renderer(p, params()).composite(input(frame, move, false)).bgr;
  const cv::Rect moved = seenFrom(right - move, kPostBox, kPost),
                 crate = seenFrom(right, kCrateBox, kCrate), behind = moved & crate;
  ASSERT_GT(behind.area(), 100);
  for (int v = behind.y + 2; v < behind.br().y; ++v) {
    for (int u = behind.x + 2; u < behind.br().x - 2; ++u)
      ASSERT_NEAR(out.at<cv::Vec3b>(v, u)[0], kCrateColour, 3) << u << ", " << v;
  }
  EXPECT_GT(out.at<cv::Vec3b>(moved.y + 10, moved.x + 6)[0], 200);  // above it, it is seen
}

// A flower on its stem, two pixels wide, before an object that is taken away, stays.
TEST(Fronts, ThinPartsOfWhatStandsBeforeAnObjectStay) {
  ClipFrame frame = frameFrom(0.0);
  RenderParams render = params();
  render.depth(kCrateBox).setTo(kWall);
  const cv::Rect board(40, 10, 100, 80), head(60, 20, 11, 11), stem(64, 31, 2, 30);
  frame.labels.setTo(0), frame.labels(board).setTo(1), frame.bgr(board).setTo(cv::Scalar::all(250));
  render.depth(board).setTo(kPost);
  cv::Mat flower = cv::Mat::zeros(kHigh, kWide, CV_8U);
  for (const cv::Rect& part : {head, stem}) flower(part).setTo(255);
  frame.labels.setTo(0, flower), frame.bgr.setTo(cv::Scalar::all(20), flower);
  render.depth.setTo(kCrate, flower);
  ClipSample clip;
  clip.add(frame);
  ObjectModel model = post();
  const Camera c = cameraAt(0.0);
  const int right = board.br().x - 1, bottom = board.br().y - 1;
  model.mesh.vertices << c.ray(board.x, board.y).transpose(), c.ray(right, board.y).transpose(),
      c.ray(right, bottom).transpose(), c.ray(board.x, bottom).transpose();
  model.mesh.vertices *= kPost;
  const auto p = std::make_shared<const Prepared>(prepare(clip, {model}, render));
  const cv::Mat out = Renderer(p, render).composite(input(frame, 0.0f, true)).bgr;
  EXPECT_EQ(cv::norm(out, frame.bgr, cv::NORM_INF, flower), 0.0);
  EXPECT_LT(out.at<cv::Vec3b>(50, 110)[0], 200);  // the board is gone
}

TEST(Fronts, InTheSunAreNotAsThePlaneBehindThem) {
  const ShadowMap all_sun({}, Eigen::Vector3d(0.0, 0.0, -1.0), {64, 0.0, 16});
  RenderParams render = params();
  Prepared p;
  p.camera = cameraAt(0.0);
  p.light.light.direction = Eigen::Vector3f(0.0f, 0.0f, -1.0f);
  p.key_labels = cv::Mat::zeros(kHigh, kWide, CV_8U);
  p.scenery = cv::Mat::zeros(kHigh, kWide, CV_32F);
  SupportPlane wall;
  wall.normal = Eigen::Vector3d(0.0, 0.0, -1.0), wall.offset = -kWall;
  render.planes = {wall};
  cv::Mat front = cv::Mat::zeros(kHigh, kWide, CV_8U);
  front(cv::Rect(kCrateBox.x - 20, kCrateBox.y, 40, 20)).setTo(255);
  p.fronts = {front};
  const cv::Mat lit = frontsInSun(all_sun, render, p);
  EXPECT_EQ(lit.at<std::uint8_t>(kCrateBox.y + 5, kCrateBox.x + 5), 255);  // on the crate
  EXPECT_EQ(lit.at<std::uint8_t>(kCrateBox.y + 5, kCrateBox.x - 15), 0);   // on the wall
  EXPECT_EQ(lit.at<std::uint8_t>(kCrateBox.y + 30, kCrateBox.x + 5), 0);   // no front
}

TEST(Uncovered, IsWhatANearerThingHidesFromTheKeyFrame) {
  cv::Mat key_nearness(kHigh, kWide, CV_32F, cv::Scalar(1.0f / kWall)), nearness;
  key_nearness(kCrateBox).setTo(1.0f / kCrate);
  nearness = cv::Mat(kHigh, kWide, CV_32F, cv::Scalar(1.0f / kWall));
  const cv::Rect now = seenFrom(0.2, kCrateBox, kCrate);  // 30 px farther left, the wall 7.5
  nearness(now).setTo(1.0f / kCrate);
  const Camera key = cameraAt(0.0), here = cameraAt(0.2);
  const cv::Mat hidden =
      hiddenAtKey(nearness, here, viewWarp(nearness, key, here), key_nearness, key);
  for (int u = 0; u < kWide; ++u) {
    const int v = kCrateBox.y + 20;
    const bool is_hidden = hidden.at<std::uint8_t>(v, u) != 0,
               surely = u > now.br().x && u < kCrateBox.br().x - 8,
               never = u < now.br().x - 1 || u > kCrateBox.br().x - 4;
    EXPECT_TRUE(is_hidden || !surely) << u;
    EXPECT_FALSE(is_hidden && never) << u;
  }
}

TEST(Uncovered, GoesOnFromWhatIsNoNearer) {
  cv::Mat nearness(kHigh, kWide, CV_32F, cv::Scalar(1.0f / kWall)),
      plate(kHigh, kWide, CV_32FC3, cv::Scalar::all(0.5)),
      holes = cv::Mat::zeros(kHigh, kWide, CV_8U);
  nearness(kCrateBox).setTo(1.0f / kCrate), plate(kCrateBox).setTo(cv::Scalar::all(0.02));
  const cv::Rect beside(kCrateBox.br().x, kCrateBox.y, 8, kCrateBox.height);
  holes(beside).setTo(255), plate(beside).setTo(cv::Scalar::all(0.02));
  continueInto(holes, nearness, plate);
  EXPECT_LT(
      cv::norm(plate(beside), cv::Mat(beside.size(), CV_32FC3, cv::Scalar::all(0.5)), cv::NORM_INF),
      1e-3);
}

}  // namespace
}  // namespace calipso::render

// What edits change of the look of a frame: copies, reflectance, gloss, and the sun.

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "ball_setting.hpp"

namespace calipso::render {
namespace {

using namespace testing;

struct BallToEdit : Setting {
  BallToEdit() : Setting(params()) {}
  FrameInput input(bool edited) const { return Setting::input(edited, Eigen::Vector3f::Zero()); }
  FrameOutput draw(const FrameInput& in) const {
    return Renderer(prepared, params()).composite(in);
  }
  cv::Point at(const Eigen::Vector3d& x) const {
    const Eigen::Vector2d p = key.camera.projectWorld(x);
    return {static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y()))};
  }
};

ObjectInFrame copyOf(const ObjectInFrame& ball, const Eigen::Vector3f& move) {
  ObjectInFrame copy = ball;
  copy.name = "twin", copy.source = "ball", copy.edited = true;
  for (Eigen::Vector3f& x : copy.vertices) x += move;
  return copy;
}

TEST(EditedLook, ACopyIsDrawnBesideAnUntouchedOriginal) {
  const BallToEdit s;
  FrameInput in = s.input(false);
  const Eigen::Vector3f move(0.22f, 0.0f, 0.0f);
  in.objects.push_back(copyOf(in.objects[0], move));
  const FrameOutput out = s.draw(in);
  const cv::Point original = s.at(kCentre), twin = s.at(kCentre + move.cast<double>());
  EXPECT_EQ(out.provenance.at<std::uint8_t>(original), kOriginal);
  EXPECT_EQ(out.provenance.at<std::uint8_t>(twin), kRendered);
  // The same matt ball in the same light looks the same.
  const auto around = [](const cv::Mat& bgr, const cv::Point& p) {
    return cv::mean(bgr(cv::Rect(p.x - 1, p.y - 1, 3, 3)));
  };  // noise averaged
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(around(out.bgr, twin)[c], around(s.key.bgr, original)[c], 12);
}

TEST(EditedLook, ACopyThatAStateDoesNotHaveIsNotDrawn) {
  const BallToEdit s;
  Renderer renderer(s.prepared, params());
  FrameInput with = s.input(false);
  with.objects.push_back(copyOf(with.objects[0], {0.22f, 0.0f, 0.0f}));
  renderer.composite(with);
  const FrameInput moved = [&] {
    FrameInput in = s.input(true);
    for (Eigen::Vector3f& x : in.objects[0].vertices) x.z() += 0.05f;
    return in;
  }();
  const FrameOutput after = renderer.composite(moved), alone = s.draw(moved);
  EXPECT_EQ(cv::norm(after.bgr, alone.bgr, cv::NORM_INF), 0.0) << "a frame depends on itself alone";
}

TEST(EditedLook, ACopyOfNothingIsRefused) {
  const BallToEdit s;
  FrameInput in = s.input(false);
  in.objects.push_back(copyOf(in.objects[0], {0.2f, 0.0f, 0.0f}));
  in.objects.back().source = "teapot";
  EXPECT_THROW(s.draw(in), std::invalid_argument);
}

// A square of 6 cm, upright, facing the camera.
ObjectInFrame card(const Eigen::Vector3d& centre) {
  ObjectInFrame o;
  o.name = "card", o.edited = true;
  const Eigen::Vector3f c = centre.cast<float>();
  for (const auto& [x, z] :
       {std::pair{-0.03f, -0.03f}, {0.03f, -0.03f}, {0.03f, 0.03f}, {-0.03f, 0.03f}})
    o.vertices.push_back(c + Eigen::Vector3f(x, 0.0f, z));
  o.triangles = {{0, 1, 2}, {0, 2, 3}};
  o.look.albedo = cv::Vec3f(0.02f, 0.02f, 0.6f);
  return o;
}

TEST(EditedLook, AnInsertedObjectIsDrawnInItsColour) {
  const BallToEdit s;
  FrameInput in = s.input(false);
  const Eigen::Vector3d centre = kCentre + Eigen::Vector3d(0.2, 0.0, 0.0);
  in.objects.push_back(card(centre));
  const FrameOutput out = s.draw(in);
  EXPECT_EQ(out.provenance.at<std::uint8_t>(s.at(kCentre)), kOriginal);
  EXPECT_EQ(out.provenance.at<std::uint8_t>(s.at(centre)), kRendered);
  const cv::Vec3b red = out.bgr.at<cv::Vec3b>(s.at(centre));
  EXPECT_GT(red[2], 3 * red[0]);
  EXPECT_GT(red[2], 3 * red[1]);
}

TEST(EditedLook, AnInsertedObjectIsHiddenByWhatStandsBeforeIt) {
  const BallToEdit s;
  FrameInput in = s.input(true);  // the ball is drawn
  in.objects.push_back(card(kCentre + Eigen::Vector3d(0.0, 0.3, 0.0)));
  const FrameOutput with = s.draw(in);
  in.objects.pop_back();
  EXPECT_EQ(with.bgr.at<cv::Vec3b>(s.at(kCentre)), s.draw(in).bgr.at<cv::Vec3b>(s.at(kCentre)));
}

// What the video shows beside the object's drawing goes along with the object, not with what is
// before it.
TEST(EditedLook, NothingOfAnObjectBehindShowsThroughAnInsertedOne) {
  const BallToEdit s;
  FrameInput in = s.input(true);
  in.objects.push_back(card(kCentre + Eigen::Vector3d(0.0, -0.2, 0.0)));
  const FrameOutput plain = s.draw(in);
  const cv::Point middle = s.at(kCentre + Eigen::Vector3d(0.0, -0.2, 0.0));
  const cv::Rect square(middle - cv::Point(4, 4), cv::Size(9, 9));
  const BallToEdit marked = [&] {  // with marks on the ball that its texture does not have
    BallToEdit other;
    for (int k = 0; k < 9; k += 3) other.key.bgr(square).row(k).setTo(cv::Scalar(255, 255, 255));
    return other;
  }();
  in.bgr = marked.key.bgr;
  const FrameOutput with_marks = marked.draw(in);
  EXPECT_EQ(cv::norm(plain.bgr(square), with_marks.bgr(square), cv::NORM_INF), 0.0);
}

// Removed in the frame in which it came: it was never drawn.
TEST(EditedLook, WhatIsGoneBeforeItIsDrawnIsPassedOver) {
  const BallToEdit s;
  FrameInput in = s.input(true);
  in.objects[0].look.tint = cv::Vec3f(0.2f, 0.5f, 1.0f);
  const FrameOutput alone = s.draw(in);
  ObjectInFrame gone;
  gone.name = "card", gone.removed = true;
  in.objects.push_back(gone);
  EXPECT_EQ(cv::norm(s.draw(in).bgr, alone.bgr, cv::NORM_INF), 0.0);
}

TEST(EditedLook, ATintMultipliesTheReflectance) {
  const BallToEdit s;
  FrameInput in = s.input(true);
  in.objects[0].look.tint = cv::Vec3f(1.0f, 0.5f, 0.25f);
  const FrameOutput out = s.draw(in);
  const cv::Point p = s.at(kCentre);
  for (int c = 0; c < 3; ++c) {
    const float before = linearFromCode(s.key.bgr.at<cv::Vec3b>(p)[c]),
                now = linearFromCode(out.bgr.at<cv::Vec3b>(p)[c]);
    EXPECT_NEAR(now / before, (*in.objects[0].look.tint)[c], 0.06f) << c;  // codes are rounded
  }
}

TEST(EditedLook, AnotherLookLeavesThePlaceAround) {
  const BallToEdit s;
  FrameInput in = s.input(true);
  in.objects[0].look.tint = cv::Vec3f(0.2f, 0.5f, 1.0f);
  const FrameOutput out = s.draw(in);
  cv::Mat ball, changed;
  cv::dilate(s.key.labels, ball, cv::getStructuringElement(cv::MORPH_ELLIPSE, {5, 5}));
  cv::absdiff(out.bgr, s.key.bgr, changed);
  changed.setTo(cv::Scalar::all(0), ball);
  EXPECT_EQ(cv::norm(changed, cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(out.bgr, s.key.bgr, cv::NORM_INF), 20.0);
}

TEST(EditedLook, AnAlbedoReplacesTheReflectance) {
  const BallToEdit s;
  const auto pixelAt = [&](float albedo) {
    FrameInput in = s.input(true);
    in.objects[0].look.albedo = cv::Vec3f(0.5f * albedo, albedo, albedo);
    return s.draw(in).bgr.at<cv::Vec3b>(s.at(kCentre));
  };
  const cv::Vec3b bright = pixelAt(0.3f), dark = pixelAt(0.15f);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(linearFromCode(dark[c]) / linearFromCode(bright[c]), 0.5f, 0.06f)
        << c;  // codes are rounded
  }
}

// A bright mark that no light explains is as much fainter as the light is.
TEST(EditedLook, WhatDrawingMissesFadesWithTheSun) {
  BallToEdit s;
  const cv::Point p = s.at(kCentre + Eigen::Vector3d(0.0, -0.09, 0.03));
  const cv::Rect mark(p - cv::Point(1, 1), cv::Size(3, 3));
  FrameInput in = s.input(true);
  in.bgr = s.key.bgr.clone();  // the clip that was learnt from does not have it
  in.bgr(mark).setTo(cv::Scalar(250, 250, 250));
  in.sun.factor = 0.05f;
  const cv::Vec3b dim = s.draw(in).bgr.at<cv::Vec3b>(p);
  in.bgr = s.key.bgr;
  const cv::Vec3b around = s.draw(in).bgr.at<cv::Vec3b>(p);
  const float lit = linearFromCode(s.key.bgr.at<cv::Vec3b>(p)[1]);
  const float factor = linearFromCode(around[1]) / lit;
  ASSERT_LT(factor, 0.7f);
  for (int c = 0; c < 3; ++c) EXPECT_LT(linearFromCode(dim[c]), 1.1f * factor) << c;
}

// It shows the sun in one direction alone.
TEST(EditedLook, NoRoughnessAtAllIsDrawnAsLittle) {
  const BallToEdit s;
  FrameInput in = s.input(true);
  in.objects[0].look.specular = 0.5f, in.objects[0].look.roughness = 0.0f;
  const FrameOutput none = s.draw(in);
  in.objects[0].look.roughness = 0.01f;
  EXPECT_EQ(cv::norm(none.bgr, s.draw(in).bgr, cv::NORM_INF), 0.0);
}

TEST(EditedLook, AnotherSunLightsTheOtherSide) {
  const BallToEdit s;
  FrameInput in = s.input(true);
  for (Eigen::Vector3f& x : in.objects[0].vertices) x.z() += 0.02f;
  const Eigen::Vector3d centre = kCentre + Eigen::Vector3d(0, 0, 0.02);
  const cv::Point left = s.at(centre + Eigen::Vector3d(-0.07, -0.05, 0)),
                  right = s.at(centre + Eigen::Vector3d(0.07, -0.05, 0));
  in.sun.direction = Eigen::Vector3f(-1.0f, -0.4f, 0.5f).normalized();
  const FrameOutput from_left = s.draw(in);
  in.sun.direction = Eigen::Vector3f(1.0f, -0.4f, 0.5f).normalized();
  const FrameOutput from_right = s.draw(in);
  EXPECT_GT(from_left.bgr.at<cv::Vec3b>(left)[2], from_right.bgr.at<cv::Vec3b>(left)[2] + 15);
  EXPECT_LT(from_left.bgr.at<cv::Vec3b>(right)[2], from_right.bgr.at<cv::Vec3b>(right)[2] - 15);
}

}  // namespace
}  // namespace calipso::render

#include "calipso_align/rigid_shape.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "../src/body_pose.hpp"
#include "../src/surface_motion.hpp"
#include "calipso_align/mask_edge.hpp"
#include "calipso_align/mask_tracker.hpp"
#include "synthetic_picture.hpp"
#include "synthetic_shape.hpp"

namespace calipso::align {
namespace {

using testing::intersectionOverUnion;

// A painted pear, as it is seen after a motion in the camera frame.
class PaintedPear {
 public:
  PaintedPear() : camera_(test::frontCamera()), mesh_(test::pear(36, 48)) {
    surface_ = {test::inCamera(camera_, Eigen::Isometry3d::Identity(), mesh_.vertices),
                mesh_.triangles, camera_};
  }

  const ModelSurface& surface() const { return surface_; }

  cv::Mat mask(const Eigen::Isometry3d& motion, double stretch = 1.0) const {
    return maskOf(renderDepth(moved(motion, stretch), mesh_.triangles, camera_), camera_);
  }

  // Blotches on the pear, and behind it blotches of the same colours that stand still.
  cv::Mat picture(const Eigen::Isometry3d& motion, int seed, double stretch = 1.0) const {
    const DepthRendering view = renderDepth(moved(motion, stretch), mesh_.triangles, camera_);
    cv::Mat image(camera_.height, camera_.width, CV_8UC3);
    cv::RNG rng(seed);
    for (int v = 0; v < image.rows; ++v)
      for (int u = 0; u < image.cols; ++u) {
        const double depth = view.at(u, v);
        Eigen::Vector3d p = 0.008 * Eigen::Vector3d(u, v, 200.0);
        if (depth > 0.0) p = motion.inverse() * Eigen::Vector3d(depth * camera_.ray(u, v));
        const double bright = std::sin(17.0 * p.x() + 3.0) * std::sin(13.0 * p.y() + 5.0 * p.z());
        for (int c = 0; c < 3; ++c)
          image.at<cv::Vec3b>(v, u)[c] = cv::saturate_cast<uchar>(
              110.0 + 60.0 * bright + (depth > 0.0 ? 12.0 : -12.0) * (c - 1) + rng.gaussian(2.0));
      }
    cv::GaussianBlur(image, image, {3, 3}, 0.6);
    return image;
  }

 private:
  Points moved(const Eigen::Isometry3d& motion, double stretch) const {
    Points x = surface_.points;
    x.col(0) *= stretch;
    return transformed(motion, x);
  }

  Camera camera_;
  TriangleMesh mesh_;
  ModelSurface surface_;
};

// Turns about an axis through the pear and drifts sideways.
Eigen::Isometry3d motionAt(int frame) {
  const Eigen::Vector3d centre(0.0, 0.0, 3.0), axis(0.3, 0.9, 0.2);
  const Eigen::AngleAxisd turn(0.05 * frame, axis.normalized());
  const Eigen::Vector3d to = centre + frame * Eigen::Vector3d(0.018, 0.004, 0.0);
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = turn.toRotationMatrix();
  motion.translation() = to - motion.linear() * centre;
  return motion;
}

TEST(BodyPose, JacobianMatchesDifferences) {
  const Camera camera = test::frontCamera();
  const BodyPose pose{{0.1, -0.2, 2.5}, motionAt(4)};
  const Eigen::Vector3d point(0.25, 0.1, 2.8), p = pose.camera_from_key * point;
  const Eigen::Matrix<double, 2, 6> J = pose.jacobian(camera, p);
  constexpr double h = 1e-5;
  for (int k = 0; k < 6; ++k) {
    BodyPose ahead = pose, behind = pose;
    ahead.move(h * Vector6::Unit(k));
    behind.move(-h * Vector6::Unit(k));
    const Eigen::Vector2d difference = (camera.project(ahead.camera_from_key * point) -
                                        camera.project(behind.camera_from_key * point)) /
                                       (2.0 * h);
    // Central differences: the error is of order h^2 times the third derivative, some 1e-6 px.
    EXPECT_LT((difference - J.col(k)).norm(), 1e-4) << "parameter " << k;
  }
}

TEST(SurfaceMotion, ShadingThatStaysDoesNotHoldATurningBodyBack) {
  const PaintedPear pear;
  const Camera& camera = pear.surface().camera;
  const auto viewAt = [&](int frame) {
    return renderDepth(transformed(motionAt(frame), pear.surface().points),
                       pear.surface().triangles, camera);
  };
  // Faint paint, lit from the right.
  const auto picture = [&](int frame) {
    cv::Mat grey;
    cv::cvtColor(pear.picture(motionAt(frame), frame + 1), grey, cv::COLOR_BGR2GRAY);
    const DepthRendering view = viewAt(frame);
    const auto positionAt = [&](int u, int v) -> Eigen::Vector3d {
      return view.at(u, v) * camera.ray(u, v);
    };
    for (int v = 1; v < grey.rows - 1; ++v)
      for (int u = 1; u < grey.cols - 1; ++u) {
        if (!(view.at(u, v) > 0.0)) continue;
        const Eigen::Vector3d normal = (positionAt(u, v + 1) - positionAt(u, v - 1))
                                           .cross(positionAt(u + 1, v) - positionAt(u - 1, v))
                                           .normalized();
        const double light = 1.0 + 0.5 * normal.x();
        grey.at<uchar>(v, u) = cv::saturate_cast<uchar>(light * (60 + 0.4 * grey.at<uchar>(v, u)));
      }
    return grey;
  };
  BodyPose pose{{0.0, 0.0, 3.0}};
  const cv::Mat still = cv::Mat::zeros(camera.height, camera.width, CV_32FC2);
  followSurface({picture(0), picture(2), still}, insideOf(pear.mask(motionAt(0))), camera,
                viewAt(0), Eigen::Isometry3d::Identity(), pose);
  const Eigen::Matrix3d off = pose.camera_from_key.linear() * motionAt(2).linear().transpose();
  EXPECT_LT(Eigen::AngleAxisd(off).angle(), 0.02) << "of 0.1 rad";
}

TEST(RigidShape, FollowsATurningBodyBeforeItsOwnColours) {
  const PaintedPear pear;
  const cv::Mat key = pear.mask(motionAt(0));
  MaskTracker tracker(pear.picture(motionAt(0), 1), key / 255, {{1, pear.surface()}});
  for (int k = 1; k <= 10; ++k) {
    const TrackedMask tracked = tracker.track(pear.picture(motionAt(k), k + 1));
    // A pixel of some 400 along the outline of 25,000: 0.016.
    EXPECT_GE(intersectionOverUnion(tracked.labels == 1, pear.mask(motionAt(k))), 0.98)
        << "frame " << k;
  }
}

// A ball without a model passes behind it, of the same paint.
TEST(MaskTracker, WhatLooksLikeAModelledBodyDoesNotTakeItOver) {
  const PaintedPear pear;
  constexpr double kRadius = 32.0;
  const auto ball = [](int frame) { return testing::disc(50.0 + 7.0 * frame, 130.0, kRadius); };
  const auto labels = [&](int frame) {
    cv::Mat both = testing::maskOf(pear.mask(motionAt(0)).size(), ball(frame)) / 255 * 2;
    both.setTo(1, pear.mask(motionAt(frame)));
    return both;
  };
  const auto picture = [&](int frame) {
    cv::Mat image = pear.picture(motionAt(frame), frame + 1);
    const cv::Mat visible = labels(frame) == 2;
    for (int v = 0; v < image.rows; ++v)
      for (int u = 0; u < image.cols; ++u) {
        if (!visible.at<uchar>(v, u)) continue;
        const double bright = std::sin(0.25 * (u - 7.0 * frame)) * std::sin(0.2 * v);
        for (int c = 0; c < 3; ++c)
          image.at<cv::Vec3b>(v, u)[c] =
              cv::saturate_cast<uchar>(110.0 + 60.0 * bright + 12.0 * (c - 1));
      }
    return image;
  };
  MaskTracker tracker(picture(0), labels(0), {{1, pear.surface()}});
  for (int k = 1; k <= 12; ++k) {
    const cv::Mat found = tracker.track(picture(k)).labels, truth = labels(k);
    EXPECT_GE(intersectionOverUnion(found == 1, truth == 1), 0.97) << "frame " << k;
  }
}

// A post stands before the place through which it goes: what comes out beyond is its own again.
TEST(MaskTracker, GoesOnBeyondAPostThatHidesItInPart) {
  const PaintedPear pear;
  const cv::Rect post(250, 0, 18, pear.mask(motionAt(0)).rows);
  const auto motion = [](int frame) { return motionAt(2 * frame); };
  const auto truth = [&](int frame) {
    cv::Mat mask = pear.mask(motion(frame)).clone();
    mask(post).setTo(0);
    return mask;
  };
  const auto picture = [&](int frame) {
    cv::Mat image = pear.picture(motion(frame), frame + 1);
    cv::RNG rng(100 + frame);
    for (int v = post.y; v < post.br().y; ++v)
      for (int u = post.x; u < post.br().x; ++u)
        for (int c = 0; c < 3; ++c)
          image.at<cv::Vec3b>(v, u)[c] = cv::saturate_cast<uchar>(
              40.0 + 45.0 * c + 10.0 * std::sin(0.9 * u) + rng.gaussian(2.0));
    return image;
  };
  MaskTracker tracker(picture(0), truth(0) / 255, {{1, pear.surface()}});
  for (int k = 1; k <= 10; ++k) {
    const cv::Mat found = tracker.track(picture(k)).labels == 1;
    EXPECT_GE(intersectionOverUnion(found, truth(k)), 0.95) << "frame " << k;
    EXPECT_LE(cv::countNonZero(found(post)), post.area() / 50) << "frame " << k;
  }
}

// At rest a surface looks the same in every frame; turning, it does not, and shows new sides.
TEST(RigidShape, HoldsWhenABodyThatRestedStartsToTurn) {
  const PaintedPear pear;
  MaskTracker tracker(pear.picture(motionAt(0), 1), pear.mask(motionAt(0)) / 255,
                      {{1, pear.surface()}});
  for (int k = 1; k <= 2; ++k) tracker.track(pear.picture(motionAt(0), k + 1));
  for (int k = 1; k <= 8; ++k) {
    const Eigen::Isometry3d motion = motionAt(3 * k);
    const TrackedMask tracked = tracker.track(pear.picture(motion, k + 3));
    EXPECT_GE(intersectionOverUnion(tracked.labels == 1, pear.mask(motion)), 0.97) << "frame " << k;
  }
}

// The model may lack details that the mask has.
TEST(RigidShape, KeepsWhatTheMaskHadBesides) {
  const PaintedPear pear;
  cv::Mat mask = pear.mask(motionAt(0));
  const cv::Rect knob(cv::boundingRect(mask).br().x - 3, 110, 16, 16);
  mask(knob).setTo(255);
  RigidShape shape(pear.surface(), mask);
  ASSERT_TRUE(shape.holds());
  const cv::Rect whole(cv::Point(), mask.size());
  EXPECT_EQ(cv::countNonZero((shape.distance(whole) < 0.0f) != (mask > 0)), 0);
  const cv::Rect part(40, 20, 220, 200);
  shape.carryDetails(cv::Mat::zeros(part.size(), CV_32FC2), part);
  EXPECT_EQ(cv::countNonZero((shape.distance(part) < 0.0f) != (mask(part) > 0)), 0);
}

// Its surface may come to look otherwise, as by turning in the light: the outline says that it is
// there.
TEST(RigidShape, IsKeptWhileItsOutlineIsPlainlyMet) {
  const PaintedPear pear;
  const Eigen::Isometry3d still = Eigen::Isometry3d::Identity();
  const cv::Mat mask = pear.mask(still), nowhere = cv::Mat::zeros(mask.size(), CV_8U),
                flow = cv::Mat::zeros(mask.size(), CV_32FC2);
  const cv::Rect whole(cv::Point(), mask.size());
  cv::Mat grey, noise(mask.size(), CV_8U), speckled, evidence;
  cv::cvtColor(pear.picture(still, 1), grey, cv::COLOR_BGR2GRAY);
  cv::RNG(2).fill(noise, cv::RNG::UNIFORM, 0, 12);
  cv::add(grey, noise, speckled);
  mask.convertTo(evidence, CV_32F, 6.0 / 255.0, -3.0);
  RigidShape shape(pear.surface(), mask);
  for (const cv::Mat& now : {grey, speckled}) {
    shape.moveAlong(grey, now, flow, mask);
    shape.meetOutline(evidence, nowhere, whole);
    EXPECT_TRUE(shape.holds());
  }
}

TEST(RigidShape, IsGivenUpWhenTheBodyDeforms) {
  const PaintedPear pear;
  const Eigen::Isometry3d still = Eigen::Isometry3d::Identity();
  const cv::Rect whole(0, 0, 320, 240);
  RigidShape shape(pear.surface(), pear.mask(still));
  const cv::Mat nowhere = cv::Mat::zeros(whole.size(), CV_8U);
  const auto frame = [&](double stretch) {
    cv::Mat grey;
    cv::cvtColor(pear.picture(still, 1, stretch), grey, cv::COLOR_BGR2GRAY);
    return grey;
  };
  const auto track = [&](double from, double to) {
    const cv::Mat flow = cv::Mat::zeros(whole.size(), CV_32FC2), mask = pear.mask(still, to);
    shape.moveAlong(frame(from), frame(to), flow, mask);
    cv::Mat evidence;
    mask.convertTo(evidence, CV_32F, 6.0 / 255.0, -3.0);
    shape.meetOutline(evidence, nowhere, whole);
  };
  track(1.0, 1.0);
  EXPECT_TRUE(shape.holds());
  track(1.0, 1.15);
  EXPECT_FALSE(shape.holds());
}

TEST(RigidShape, AModelThatDoesNotMeetItsMaskIsOfNoUse) {
  const PaintedPear pear;
  cv::Mat half = pear.mask(motionAt(0));
  half.colRange(0, 160).setTo(0);
  EXPECT_FALSE(RigidShape(pear.surface(), half).holds());
}

}  // namespace
}  // namespace calipso::align

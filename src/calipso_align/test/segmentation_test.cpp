#include "calipso_align/segmentation.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <opencv2/imgproc.hpp>
#include <string>

#include "synthetic_picture.hpp"

namespace calipso::align {
namespace {

using testing::box;
using testing::disc;
using testing::intersectionOverUnion;
using testing::maskOf;
using testing::paint;

const cv::Size kSize(160, 120);
const cv::Vec3b kGreen(40, 160, 60), kRed(40, 40, 190), kGrey(150, 150, 150);

std::string messageOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing was thrown";
}

void expectContains(const std::string& message, const std::string& part) {
  EXPECT_NE(message.find(part), std::string::npos) << "message was: " << message;
}

TEST(Segmenter, FindsADiscFromItsRectangle) {
  const auto shape = disc(80.3, 60.7, 30.2);
  const cv::Mat image = paint(kSize, shape, kGreen, kGrey, 3.0);
  Segmenter segmenter(image, {{"disc", 7, cv::Rect(45, 25, 72, 72), {}}});
  const cv::Mat labels = segmenter.segment({});
  // One pixel of uncertainty along a fifth of the edge costs about 1 %.
  EXPECT_GE(intersectionOverUnion(labels == 7, maskOf(kSize, shape)), 0.985);
}

// A box whose lower part is nearly the background's colour, and without a stroke.
TEST(Segmenter, AFittedModelBringsInColoursWithoutStroke) {
  const cv::Vec3b nearly(150, 150, 164);
  const auto whole = box(59.5, 29.5, 99.5, 89.5), lower = box(59.5, 79.5, 99.5, 89.5);
  const cv::Mat image =
      paint(kSize, lower, nearly, kGrey, 0.0, paint(kSize, whole, kGreen, kGrey, 3.0));
  cv::Mat strokes = cv::Mat::zeros(kSize, CV_8U);
  cv::line(strokes, {65, 40}, {95, 70}, 1, 3);
  SegmentationTarget target{"box", 1, cv::Rect(45, 20, 70, 85), {}};
  Segmenter alone(image, {target});
  EXPECT_LT(intersectionOverUnion(alone.segment(strokes) == 1, maskOf(kSize, whole)), 0.86);
  target.fit_model = [&](const std::vector<ContourLoop>& contour) -> std::optional<ModelView> {
    EXPECT_EQ(contour.size(), 1u);
    return ModelView{maskOf(kSize, whole), cv::Mat1f::zeros(kSize), 1.5};
  };
  Segmenter guided(image, {target});
  EXPECT_GE(intersectionOverUnion(guided.segment(strokes) == 1, maskOf(kSize, whole)), 0.97);
}

// A post of the object's own colour, which the depth image shows nearer than any of the object.
TEST(Segmenter, WhatStandsBeforeAnObjectIsNotItsPart) {
  const auto whole = box(49.5, 29.5, 109.5, 89.5), post = box(69.5, 39.5, 79.5, 69.5);
  const cv::Mat image = paint(kSize, whole, kGreen, kGrey, 3.0);
  cv::Mat depth(kSize, CV_32F, cv::Scalar(8.0f));
  depth.setTo(4.0f, maskOf(kSize, whole)), depth.setTo(3.0f, maskOf(kSize, post));
  cv::Mat strokes = cv::Mat::zeros(kSize, CV_8U);
  cv::line(strokes, {90, 40}, {105, 80}, 1, 3);
  SegmentationTarget target{"box", 1, cv::Rect(40, 20, 80, 80), {}};
  target.fit_model = [&](const std::vector<ContourLoop>&) -> std::optional<ModelView> {
    cv::Mat1f surface = cv::Mat1f::zeros(kSize);
    surface.setTo(4.0f, maskOf(kSize, whole));
    return ModelView{maskOf(kSize, whole), surface, 1.5};
  };
  Segmenter segmenter(image, {target}, {}, depth);
  const cv::Mat own = maskOf(kSize, whole) & ~maskOf(kSize, post);
  EXPECT_GE(intersectionOverUnion(segmenter.segment(strokes) == 1, own), 0.97);
}

// Where the object is said to be there is nothing but more of the background; its model alone says
// where it ends.
TEST(Segmenter, SaysThatAnObjectMayNotBeInThePicture) {
  const auto shape = disc(80.3, 60.7, 30.2);
  SegmentationTarget target{"disc", 7, cv::Rect(45, 25, 72, 72), {}};
  target.fit_model = [&](const std::vector<ContourLoop>&) {
    return ModelView{maskOf(kSize, shape), cv::Mat1f::zeros(kSize), 1.5, {}};
  };
  cv::Mat strokes = cv::Mat::zeros(kSize, CV_8U);
  cv::circle(strokes, {80, 60}, 20, 7, cv::FILLED);
  Segmenter present(paint(kSize, shape, kGreen, kGrey, 3.0), {target});
  EXPECT_TRUE(present.remarks().empty());
  present.segment(strokes);
  EXPECT_TRUE(present.remarks().empty());

  Segmenter absent(paint(kSize, shape, kGrey, kGrey, 3.0), {target});
  absent.segment(strokes);
  ASSERT_EQ(absent.remarks().size(), 1u);
  EXPECT_NE(absent.remarks()[0].find("'disc'"), std::string::npos);
  EXPECT_NE(absent.remarks()[0].find("first frame"), std::string::npos);
}

TEST(Segmenter, AModelThatCannotBeFittedChangesNothing) {
  const auto shape = disc(80.3, 60.7, 30.2);
  const cv::Mat image = paint(kSize, shape, kGreen, kGrey, 3.0);
  SegmentationTarget target{"disc", 7, cv::Rect(45, 25, 72, 72), {}};
  Segmenter alone(image, {target});
  const cv::Mat before = alone.segment({}).clone();
  target.fit_model = [](const std::vector<ContourLoop>&) { return std::nullopt; };
  Segmenter guided(image, {target});
  EXPECT_EQ(cv::countNonZero(guided.segment({}) != before), 0);
}

// Only what may move as a whole hands on its surface.
TEST(Segmenter, HandsOnTheModelsThatMoveAsAWhole) {
  const auto shape = disc(80.3, 60.7, 30.2);
  const cv::Mat image = paint(kSize, shape, kGreen, kGrey, 3.0);
  const auto modelsWith = [&](const ModelSurface& surface) {
    SegmentationTarget target{"disc", 7, cv::Rect(45, 25, 72, 72), {}};
    target.fit_model = [&](const std::vector<ContourLoop>&) {
      return ModelView{maskOf(kSize, shape), cv::Mat1f::zeros(kSize), 1.5, surface};
    };
    Segmenter segmenter(image, {target});
    EXPECT_TRUE(segmenter.models().empty());
    segmenter.segment({});
    return segmenter.models();
  };
  EXPECT_TRUE(modelsWith({}).empty());
  const auto models = modelsWith({Points::Ones(3, 3), Triangles::Zero(1, 3), {}});
  ASSERT_EQ(models.size(), 1u);
  EXPECT_EQ(models.at(7).points.rows(), 3);
}

TEST(Segmenter, GivesTouchingObjectsTheirOwnPixels) {
  // Edges between pixels: a mixed pixel would belong to either side.
  const auto left = box(29.5, 29.5, 79.5, 89.5), right = box(79.5, 29.5, 129.5, 89.5);
  const cv::Mat image =
      paint(kSize, right, kRed, kGrey, 3.0, paint(kSize, left, kGreen, kGrey, 0.0));
  cv::Mat strokes = cv::Mat::zeros(kSize, CV_8U);
  cv::line(strokes, {40, 60}, {70, 60}, 1, 3);
  cv::line(strokes, {90, 60}, {120, 60}, 2, 3);
  Segmenter segmenter(image, {{"left", 1, cv::Rect(25, 25, 90, 70), {}},
                              {"right", 2, cv::Rect(50, 25, 90, 70), {}}});
  const cv::Mat labels = segmenter.segment(strokes);
  EXPECT_GE(intersectionOverUnion(labels == 1, maskOf(kSize, left)), 0.97);
  EXPECT_GE(intersectionOverUnion(labels == 2, maskOf(kSize, right)), 0.97);
}

TEST(Segmenter, LeavesAHoleOpen) {
  const auto ring = [](double u, double v) {
    const double r = std::hypot(u - 80, v - 60);
    return std::max(r - 40.0, 18.0 - r);
  };
  const cv::Mat image = paint(kSize, ring, kGreen, kGrey, 3.0);
  Segmenter segmenter(image, {{"ring", 1, cv::Rect(36, 16, 89, 89), {}}});
  const cv::Mat labels = segmenter.segment({});
  EXPECT_EQ(labels.at<uchar>(60, 80), 0);
  EXPECT_GE(intersectionOverUnion(labels == 1, maskOf(kSize, ring)), 0.97);
}

TEST(Segmenter, ALaterStrokeTakesAPartAway) {
  const auto object = box(30, 30, 80, 90), twin = box(90, 30, 130, 90);
  const cv::Mat image =
      paint(kSize, twin, kGreen, kGrey, 3.0, paint(kSize, object, kGreen, kGrey, 0.0));
  Segmenter segmenter(image, {{"object", 1, cv::Rect(25, 25, 110, 70), {}}});
  EXPECT_NE(segmenter.segment({}).at<uchar>(60, 110), 0);
  cv::Mat strokes = cv::Mat::zeros(kSize, CV_8U);
  cv::line(strokes, {40, 60}, {70, 60}, 1, 3);
  cv::rectangle(strokes, {94, 34}, {126, 86}, kBackgroundStroke, 3);
  cv::line(strokes, {94, 60}, {126, 60}, kBackgroundStroke, 3);
  const cv::Mat labels = segmenter.segment(strokes);
  EXPECT_EQ(cv::countNonZero((labels == 1) & (strokes == kBackgroundStroke)), 0);
  EXPECT_GE(cv::countNonZero((labels == 1) & maskOf(kSize, object)),
            0.95 * cv::countNonZero(maskOf(kSize, object)));
}

TEST(Segmenter, TwoRunsAreByteIdentical) {
  const cv::Mat image = paint(kSize, disc(80, 60, 30), kGreen, kGrey, 8.0);
  const std::vector<SegmentationTarget> targets = {{"disc", 1, cv::Rect(40, 20, 80, 80), {}}};
  Segmenter first(image, targets), second(image, targets);
  EXPECT_EQ(cv::countNonZero(first.segment({}) != second.segment({})), 0);
}

TEST(Segmenter, NamesWhatIsWrongWithTheInput) {
  const cv::Mat image = paint(kSize, disc(80, 60, 30), kGreen, kGrey);
  const std::vector<SegmentationTarget> good = {{"disc", 1, cv::Rect(40, 20, 80, 80), {}}};
  expectContains(messageOf([&] { Segmenter(cv::Mat(), good); }), "empty");
  expectContains(messageOf([&] { Segmenter(image, {}); }), "no object");
  expectContains(messageOf([&] {
                   Segmenter(image, {{"far", 1, {500, 5, 9, 9}, {}}});
                 }),
                 "object 'far': rectangle 500 5 9 9 does not meet the picture");
  expectContains(messageOf([&] {
                   Segmenter(image, {{"odd", 255, {5, 5, 9, 9}, {}}});
                 }),
                 "index 255 is not in 1..254");
  expectContains(messageOf([&] {
                   Segmenter(image, {{"a", 1, {5, 5, 9, 9}, {}}, {"b", 1, {5, 5, 9, 9}, {}}});
                 }),
                 "also another object's");
  Segmenter segmenter(image, good);
  expectContains(messageOf([&] { segmenter.segment(cv::Mat::zeros(5, 5, CV_8U)); }), "5x5");
  expectContains(messageOf([&] { segmenter.segment(cv::Mat(kSize, CV_8U, cv::Scalar(3))); }),
                 "value 3 names no object");
}

TEST(Segmenter, StrokesThatLeaveNoForegroundNameTheObject) {
  const cv::Mat image = paint(kSize, disc(80, 60, 30), kGreen, kGrey);
  Segmenter segmenter(image, {{"disc", 1, cv::Rect(40, 20, 80, 80), {}}});
  const std::string message =
      messageOf([&] { segmenter.segment(cv::Mat(kSize, CV_8U, cv::Scalar(kBackgroundStroke))); });
  expectContains(message, "object 'disc'");
  expectContains(message, "draw a stroke");
}

}  // namespace
}  // namespace calipso::align

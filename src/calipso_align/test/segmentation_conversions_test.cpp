#include "ros/segmentation_conversions.hpp"

#include <gtest/gtest.h>

#include <boost/make_shared.hpp>
#include <string>

namespace calipso::align {
namespace {

ObjectContour triangle() {
  ContourLoop loop;
  loop.points = {{1.5, 2.25}, {10.0, 2.5}, {5.75, 8.0}};
  loop.confidence = {0.25f, 1.0f, 0.0f};
  loop.known = {true, true, false};
  loop.hole = true;
  return {"kite", 9, {loop}};
}

TEST(SegmentationConversions, ContourRoundTrip) {
  const ObjectContour before = triangle(), after = fromMsg(toMsg(before));
  EXPECT_EQ(after.object, before.object);
  EXPECT_EQ(after.label, before.label);
  ASSERT_EQ(after.loops.size(), 1u);
  EXPECT_EQ(after.loops[0].points, before.loops[0].points);  // exact: they fit into float
  EXPECT_EQ(after.loops[0].confidence, before.loops[0].confidence);
  EXPECT_EQ(after.loops[0].known, before.loops[0].known);
  EXPECT_TRUE(after.loops[0].hole);
}

TEST(SegmentationConversions, UnequalArraysAreNamed) {
  calipso_msgs::ObjectContour msg = toMsg(triangle());
  msg.loops[0].v.pop_back();
  try {
    fromMsg(msg);
    FAIL() << "nothing was thrown";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("'kite', loop 0"), std::string::npos) << error.what();
  }
}

TEST(SegmentationConversions, LabelsRoundTrip) {
  cv::Mat labels(12, 17, CV_8U);
  cv::RNG(3).fill(labels, cv::RNG::UNIFORM, 0, 4);
  std_msgs::Header header;
  header.stamp = ros::Time(4.5);
  const auto msg = toMsg(header, labels, {}, 0.5f);
  EXPECT_EQ(msg.header.stamp, msg.labels.header.stamp);
  EXPECT_EQ(cv::countNonZero(labelsFromMsg(msg.labels) != labels), 0);
}

TEST(SegmentationConversions, RejectsWhatIsNoPicture) {
  auto image = boost::make_shared<sensor_msgs::Image>();
  EXPECT_THROW(colourImageFromMsg(image), std::invalid_argument);
  image->width = image->height = 4;
  image->step = 4;
  image->data.resize(16);
  image->encoding = "nonsense";
  EXPECT_THROW(colourImageFromMsg(image), std::invalid_argument);
  image->encoding = "rgb8";  // 12 bytes per row needed, 4 there
  EXPECT_THROW(colourImageFromMsg(image), std::invalid_argument);
  EXPECT_THROW(labelsFromMsg(*image), std::invalid_argument);
}

}  // namespace
}  // namespace calipso::align

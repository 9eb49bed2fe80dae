#include "calipso_ros/video_clock.hpp"

#include <gtest/gtest.h>

namespace calipso {
namespace {

TEST(VideoClock, startsOverWhenTheStampsGoFarBack) {
  VideoClock clock;
  EXPECT_FALSE(clock.startsOver(ros::Time(10.0)));
  EXPECT_FALSE(clock.startsOver(ros::Time(12.0)));
  EXPECT_TRUE(clock.startsOver(ros::Time(10.0)));
  EXPECT_FALSE(clock.startsOver(ros::Time(10.1))) << "once for each time that they go back";
}

TEST(VideoClock, jitterIsNoStart) {
  VideoClock clock;
  clock.startsOver(ros::Time(10.0));
  EXPECT_FALSE(clock.startsOver(ros::Time(9.9)));
  EXPECT_TRUE(clock.startsOver(ros::Time(9.45))) << "back from the newest, not from the last";
}

TEST(VideoClock, whatWasSaidBeforeIsNotOfThisRun) {
  VideoClock clock;
  clock.startsOver(ros::Time(12.0));
  EXPECT_TRUE(clock.covers(ros::Time(11.0)));
  clock.startsOver(ros::Time(10.0));
  EXPECT_TRUE(clock.covers(ros::Time(10.0)));
  EXPECT_TRUE(clock.covers(ros::Time(10.1))) << "another node may be ahead by some frames";
  EXPECT_FALSE(clock.covers(ros::Time(11.9)));
}

}  // namespace
}  // namespace calipso

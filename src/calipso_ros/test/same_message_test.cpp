#include "calipso_ros/same_message.hpp"

#include <calipso_msgs/AlignedModels.h>
#include <gtest/gtest.h>

#include <limits>

namespace calipso {
namespace {

calipso_msgs::AlignedModels models() {
  calipso_msgs::AlignedModels msg;
  msg.header.stamp = ros::Time(2.5);
  msg.models.resize(1);
  // Of a contour point that is unknown the residual is none.
  msg.models[0].residual_px = {0.25f, std::numeric_limits<float>::quiet_NaN()};
  return msg;
}

TEST(SameMessage, isKnownByWhatItSays) {
  calipso_msgs::AlignedModels again = models();
  again.header.seq = 7;
  EXPECT_TRUE(sameMessage(models(), again));
  again.models[0].residual_px[0] = 0.5f;
  EXPECT_FALSE(sameMessage(models(), again));
  EXPECT_FALSE(sameMessage(models(), calipso_msgs::AlignedModels()));
}

}  // namespace
}  // namespace calipso

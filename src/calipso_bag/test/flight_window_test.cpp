#include "calipso_bag/flight_window.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

using calipso::bag::FlightWindow;

TEST(FlightWindow, HoldsAsManyFramesAsItsCapacity) {
  FlightWindow window(2);
  window.sent(10);
  EXPECT_TRUE(window.hasRoom());
  window.sent(20);
  EXPECT_FALSE(window.hasRoom());
  window.cameBack(10);
  EXPECT_TRUE(window.hasRoom());
  EXPECT_EQ(window.returned(), 1);
  EXPECT_FALSE(window.empty());
}

TEST(FlightWindow, RejectsFramesOutOfOrderDoubledOrStrange) {
  FlightWindow window(3);
  window.sent(10);
  window.sent(20);
  EXPECT_THROW(window.cameBack(20), std::runtime_error);
  window.cameBack(10);
  EXPECT_THROW(window.cameBack(10), std::runtime_error);
  window.cameBack(20);
  EXPECT_THROW(window.cameBack(30), std::runtime_error);
}

TEST(FlightWindow, RejectsACapacityOfZero) { EXPECT_THROW(FlightWindow(0), std::invalid_argument); }

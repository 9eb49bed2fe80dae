#include "calipso_ros/mode.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace calipso {
namespace {

TEST(Mode, hasTwoNames) {
  EXPECT_EQ(modeFromString("bag", "mode"), Mode::kBag);
  EXPECT_EQ(modeFromString("live", "mode"), Mode::kLive);
}

TEST(Mode, refusesAnyOther) {
  try {
    modeFromString("Live", "/calipso/flow/mode");
    FAIL() << "was taken";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "parameter /calipso/flow/mode is 'Live'; give bag or live");
  }
}

}  // namespace
}  // namespace calipso

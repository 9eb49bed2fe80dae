#include "calipso_ros/params.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

namespace calipso {
namespace {

TEST(Params, aPathCountsFromWhereTheUserIs) {
  setenv("HOME", "/home/ann", 1);
  setenv("PWD", "/videos", 1);
  EXPECT_EQ(absolutePath("/data/in.bag"), "/data/in.bag");
  EXPECT_EQ(absolutePath("~/in.bag"), "/home/ann/in.bag");
  EXPECT_EQ(absolutePath("001"), "/videos/001");
  EXPECT_EQ(absolutePath("../in.bag"), "/videos/../in.bag");
}

}  // namespace
}  // namespace calipso

#include "ros/links.hpp"

#include <gtest/gtest.h>

using calipso::bag::Links;
using calipso::bag::Subscriptions;
using Names = std::vector<std::string>;

TEST(Links, NamesWhoeverIsRegisteredButNotConnected) {
  const Subscriptions registered = {{"/image", {"/flow", "/render"}}, {"/tf", {"/render"}}};
  Links links;
  links.opened("/image", "/flow");
  links.opened("/tf", "/render");
  const Names missing = links.missing(registered, {"/image", "/tf"}, {"/flow", "/render"});
  EXPECT_EQ(missing, Names{"/image to /render"});
  links.opened("/image", "/render");
  EXPECT_TRUE(links.missing(registered, {"/image", "/tf"}, {"/flow", "/render"}).empty());
}

TEST(Links, AClosedConnectionIsMissingAgain) {
  Links links;
  links.opened("/image", "/render");
  links.closed("/image", "/render");
  EXPECT_EQ(links.missing({{"/image", {"/render"}}}, {"/image"}, {"/render"}).size(), 1u);
}

TEST(Links, NeitherOtherTopicsNorStrangersAreWaitedFor) {
  const Subscriptions registered = {{"/image", {"/stranger"}}, {"/other", {"/render"}}};
  EXPECT_TRUE(Links().missing(registered, {"/image"}, {"/render"}).empty());
}

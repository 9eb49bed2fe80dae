#include "picture_file.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace calipso::render {
namespace {

namespace fs = std::filesystem;

class PictureFile : public ::testing::Test {
 protected:
  void SetUp() override { fs::remove_all(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  const std::string folder_ = ::testing::TempDir() + "picture_file_test";
  const cv::Mat picture_ = cv::Mat(4, 5, CV_8UC3, cv::Scalar(1, 2, 3));
};

template <typename Act>
std::string refusalOf(Act act) {
  try {
    act();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST_F(PictureFile, ItsFolderIsMadeWhereItIsMissing) {
  const std::string deep = folder_ + "/a/b";
  makePictureFolder(deep), makePictureFolder(deep), makePictureFolder("");
  writePicture(deep + "/x.png", picture_);
  EXPECT_EQ(cv::norm(cv::imread(deep + "/x.png"), picture_, cv::NORM_INF), 0.0);
}

TEST_F(PictureFile, WhatCannotBeWrittenIsNamed) {
  const std::string missing = folder_ + "/x.png";
  EXPECT_NE(refusalOf([&] { writePicture(missing, picture_); }).find(missing), std::string::npos);
  std::ofstream(folder_) << "a file";
  EXPECT_NE(refusalOf([&] { makePictureFolder(folder_); }).find(folder_), std::string::npos);
  EXPECT_NE(refusalOf([&] { makePictureFolder(missing); }).find(missing), std::string::npos);
}

}  // namespace
}  // namespace calipso::render

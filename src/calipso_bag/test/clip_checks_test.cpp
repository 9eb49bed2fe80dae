#include "ros/clip_checks.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "temporary_folder.hpp"

using namespace calipso::bag;

namespace {

class StrokesTest : public ::testing::Test {
 protected:
  // strokes.png with one pixel of each value
  std::string strokes(const std::vector<unsigned char>& values) const {
    const std::string path = folder_ / "strokes.png";
    cv::imwrite(path, cv::Mat1b(values, true));
    return path;
  }

  TemporaryFolder folder_;
};

}  // namespace

TEST_F(StrokesTest, MayMarkBackgroundAndAnyObjectOfTheScene) {
  EXPECT_NO_THROW(checkStrokes(strokes({0, 1, 3, 255}), {1, 2, 3}));
  EXPECT_NO_THROW(checkStrokes("", {1}));
}

TEST_F(StrokesTest, OfAnAbsentObjectAreRefusedWithTheIndicesThatAreThere) {
  const std::string said = messageOf([&] { checkStrokes(strokes({0, 1, 2, 255}), {1, 3}); });
  for (const char* part : {"strokes.png", "value 2", "(1, 3)", "erase"})
    EXPECT_NE(said.find(part), std::string::npos) << "'" << part << "' is not in: " << said;
}

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

class SameCameraTest : public ::testing::Test {
 protected:
  SameCameraTest() {
    scene_.camera.width = 640, scene_.camera.height = 360;
    scene_.camera.fx = scene_.camera.fy = 760.0;
    scene_.camera.cx = 319.5, scene_.camera.cy = 179.5;
    scene_.objects.resize(1);
    scene_.objects[0].name = "cup";
    scene_.objects[0].initial_world_from_object.translation().z() = 0.76;
    video_ = scene_.camera;
  }

  void expectComplaint(const std::vector<const char*>& parts) const {
    const std::string said = messageOf([&] { checkSameCamera(scene_, video_, "in.bag"); });
    for (const char* part : parts)
      EXPECT_NE(said.find(part), std::string::npos) << "'" << part << "' is not in: " << said;
  }

  calipso::Scene scene_;
  calipso::Camera video_;
};

TEST_F(SameCameraTest, MayDifferByWhatCannotBeSeen) {
  video_.fx += 1.0;                                    // 320 / 760 px at the sides
  video_.world_from_camera.translation().x() = 0.001;  // 1 px at 0.76 m
  EXPECT_NO_THROW(checkSameCamera(scene_, video_, "in.bag"));
}

TEST_F(SameCameraTest, OfAnotherCalibrationIsRefusedWithBoth) {
  video_.fx = video_.fy = 554.0;
  expectComplaint({"in.bag", "554, 554, 319.5, 179.5", "760, 760, 319.5, 179.5", "99 px"});
}

TEST_F(SameCameraTest, ElsewhereIsRefusedWithBothPlaces) {
  video_.world_from_camera.translation().x() = 0.02;
  expectComplaint({"in.bag", "(0.02, 0, 0) m", "(0, 0, 0) m", "20 px", "'cup'", "poses:=scene"});
  video_.world_from_camera.translation().z() = 1.0;  // past it
  expectComplaint({"inf px"});
}

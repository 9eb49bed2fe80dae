#include "calipso_scene/same_camera.hpp"

#include <gtest/gtest.h>

#include <exception>
#include <string>
#include <vector>

namespace calipso {
namespace {

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
    std::string said = "nothing was thrown";
    try {
      checkSameCamera(scene_, video_);
    } catch (const std::exception& error) {
      said = error.what();
    }
    for (const char* part : parts)
      EXPECT_NE(said.find(part), std::string::npos) << "'" << part << "' is not in: " << said;
  }

  Scene scene_;
  Camera video_;
};

TEST_F(SameCameraTest, MayDifferByWhatCannotBeSeen) {
  video_.fx += 1.0;                                    // 320 / 760 px at the sides
  video_.world_from_camera.translation().x() = 0.001;  // 1 px at 0.76 m
  EXPECT_NO_THROW(checkSameCamera(scene_, video_));
}

TEST_F(SameCameraTest, OfAnotherSizeIsRefusedWithBoth) {
  video_.width = 320, video_.height = 180;
  expectComplaint({"320x180", "640x360", "use the scene of this video"});
}

TEST_F(SameCameraTest, OfAnotherCalibrationIsRefusedWithBoth) {
  video_.fx = video_.fy = 554.0;
  expectComplaint({"554, 554, 319.5, 179.5", "760, 760, 319.5, 179.5", "99 px"});
}

TEST_F(SameCameraTest, ElsewhereIsRefusedWithBothPlaces) {
  video_.world_from_camera.translation().x() = 0.02;
  expectComplaint({"(0.02, 0, 0) m", "(0, 0, 0) m", "20 px", "'cup'", "poses:=scene"});
  video_.world_from_camera.translation().z() = 1.0;  // past it
  expectComplaint({"inf px"});
}

}  // namespace
}  // namespace calipso

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

namespace {

// A rod of `size` 1 m before a camera that sees 500 px a metre there; its rectangle is 100 px wide.
void checkRod(double size) {
  calipso::Camera camera;
  camera.fx = camera.fy = 500.0;
  calipso::SceneObject object;
  object.name = "rod";
  object.cad_path = "cad/rod.obj";
  object.rect = {10, 10, 100, 0};
  object.initial_world_from_object.translation().z() = 1.0;
  calipso::TriangleMesh rod;
  rod.vertices.resize(2, 3);
  rod.vertices << -0.5 * size, 0.0, 0.0, 0.5 * size, 0.0, 0.0;
  checkModelSize(object, rod, camera);
}

}  // namespace

TEST(ModelSize, MayDifferFromTheRectangleAsFarAsSomethingHidesIt) {
  for (const double size : {0.02, 0.2, 2.0}) EXPECT_NO_THROW(checkRod(size)) << size;
}

TEST(ModelSize, InMillimetresIsRefused) {
  for (const double size : {200.0, 2e-4}) {
    const std::string said = messageOf([&] { checkRod(size); });
    for (const char* part : {"cad/rod.obj", "px", "millimetres", "'rod'"})
      EXPECT_NE(said.find(part), std::string::npos) << "'" << part << "' is not in: " << said;
  }
}

#include "calipso_bag/calibration.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <stdexcept>

#include "temporary_folder.hpp"

using namespace calipso;
using namespace calipso::bag;

namespace {

std::string calibrationText(const std::string& matrix) {
  return "image_width: 640\nimage_height: 360\ncamera_matrix: {rows: 3, cols: 3, data: " + matrix +
         "}\ndistortion_model: plumb_bob\n"
         "distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}\n";
}

std::string written(const TemporaryFolder& folder, const std::string& text) {
  const std::string path = folder / "camera.yaml";
  std::ofstream(path) << text;
  return path;
}

}  // namespace

// 90 degrees: half the picture's width equals the focal length.
TEST(CameraFromFov, HasTheFocalLengthOfTheField) {
  const Camera camera = cameraFromFov(640, 360, 90.0);
  EXPECT_NEAR(camera.fx, 320.0, 1e-9);
  EXPECT_DOUBLE_EQ(camera.fx, camera.fy);
  EXPECT_DOUBLE_EQ(camera.cx, 319.5);
  EXPECT_DOUBLE_EQ(camera.cy, 179.5);
}

TEST(CameraFromFov, RejectsImpossibleAngles) {
  EXPECT_THROW(cameraFromFov(640, 360, 0.0), std::invalid_argument);
  EXPECT_THROW(cameraFromFov(640, 360, 180.0), std::invalid_argument);
  EXPECT_THROW(cameraFromFov(640, 360, std::stod("nan")), std::invalid_argument);
}

TEST(LoadCalibration, ReadsMatrixAndDistortion) {
  const TemporaryFolder folder;
  const Calibration c =
      loadCalibration(written(folder, calibrationText("[600, 0, 310, 0, 610, 170, 0, 0, 1]")));
  EXPECT_EQ(c.camera.width, 640);
  EXPECT_DOUBLE_EQ(c.camera.fx, 600.0);
  EXPECT_DOUBLE_EQ(c.camera.fy, 610.0);
  EXPECT_DOUBLE_EQ(c.camera.cx, 310.0);
  EXPECT_DOUBLE_EQ(c.camera.cy, 170.0);
  EXPECT_TRUE(c.distorted());
}

TEST(LoadCalibration, NamesWhatIsMissing) {
  const TemporaryFolder folder;
  const std::string path = written(folder, "image_width: 640\n");
  EXPECT_NE(messageOf([&] { loadCalibration(path); }).find("image_height"), std::string::npos);
  const std::string bad = written(folder, calibrationText("[0, 0, 310, 0, 610, 170, 0, 0, 1]"));
  EXPECT_NE(messageOf([&] { loadCalibration(bad); }).find("focal length"), std::string::npos);
  EXPECT_NE(messageOf([&] { loadCalibration("absent.yaml"); }).find("absent.yaml"),
            std::string::npos);
}

// The centre of distortion stays where it is; with barrel distortion the border moves.
TEST(Undistort, LeavesThePrincipalPointAlone) {
  Calibration c{cameraFromFov(101, 101, 90.0), {-0.3, 0.0, 0.0, 0.0, 0.0}};
  cv::Mat image(101, 101, CV_8UC3, cv::Scalar(0, 0, 0));
  image.at<cv::Vec3b>(50, 50) = {255, 255, 255};
  const cv::Mat straight = undistort(image, c);
  EXPECT_EQ(straight.at<cv::Vec3b>(50, 50), cv::Vec3b(255, 255, 255));
}

// A fisheye's four numbers mean something else. Its picture of a point 45 degrees off the axis lies
// at a distance of f pi / 4, where a pinhole's lies at f.
TEST(Undistort, AFisheyeIsUndistortedByItsOwnModel) {
  const TemporaryFolder folder;
  const std::string text =
      "image_width: 201\nimage_height: 201\ncamera_matrix: {rows: 3, cols: 3, data: "
      "[80, 0, 100, 0, 80, 100, 0, 0, 1]}\ndistortion_model: MODEL\n"
      "distortion_coefficients: {rows: 1, cols: 4, data: [0, 0, 0, 0]}\n";
  const auto of_model = [&](const std::string& model) {
    std::string named = text;
    return loadCalibration(written(folder, named.replace(named.find("MODEL"), 5, model)));
  };
  cv::Mat image(201, 201, CV_8UC3, cv::Scalar(0, 0, 0));
  image.at<cv::Vec3b>(100, 100 + cvRound(80 * CV_PI / 4)) = {255, 255, 255};
  const cv::Mat straight = undistort(image, of_model("equidistant"));
  EXPECT_GT(straight.at<cv::Vec3b>(100, 180)[0], 50);
  EXPECT_NE(messageOf([&] { of_model("cylinder"); }).find("distortion_model is 'cylinder'"),
            std::string::npos);
}

#include "calipso_scene/scene.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <vector>

namespace calipso {
namespace {

const std::string kHead =
    "name: desk\nfps: 30\nn_frames: 2\nwidth: 64\nheight: 36\nfx: 76\nfy: 76\ncx: 31.5\ncy: 17.5\n";
const std::string kPose =
    "world_T_camera: [[1, 0, 0, 0], [0, 0, 1, -2], [0, -1, 0, 1], [0, 0, 0, 1]]\n";
const std::string kObject =
    "objects:\n- {name: ball, index: 1, cad: cad/ball.obj, rect_xywh: [3, 4, 20, 10],\n"
    "   initial_world_T_object: [[1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]]}\n";

std::string writeScene(const std::string& yaml) {
  const std::string directory = testing::TempDir() + "scene";
  std::filesystem::create_directories(directory);
  std::ofstream(directory + "/scene.yaml") << yaml;
  return directory;
}

std::string errorOf(const std::string& yaml) {
  try {
    loadScene(writeScene(yaml));
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST(Scene, readsWhatAUserGives) {
  const Scene scene = loadScene(writeScene(
      kHead + kPose + kObject + "support:\n- {plane: [0, 0, 2, 1], name: table}\n" +
      "attachment_hints:\n  ball:\n  - {name: peg, box_min: [0, 0, 0], box_max: [1, 1, 1]}\n"));
  EXPECT_EQ(scene.name, "desk");
  EXPECT_EQ(scene.frame_pattern, "frames/%06d.jpg");
  ASSERT_EQ(scene.planes.size(), 1u);
  EXPECT_DOUBLE_EQ(scene.planes[0].offset, 0.5);  // normalised with the normal
  const SceneObject& ball = scene.object("ball");
  EXPECT_EQ(ball.initial_world_from_object.translation(), Eigen::Vector3d(5, 6, 7));
  ASSERT_EQ(ball.attachments.size(), 1u);
  EXPECT_TRUE(scene.depth_path.empty());
}

TEST(Scene, nameAndNumberOfFramesAreTheFoldersWhereTheFileHasNone) {
  const std::string fps_on = kHead.substr(kHead.find("fps"));
  const auto without = [&](const std::string& line) {
    std::string yaml = fps_on;
    return yaml.erase(yaml.find(line), line.size()) + kPose + kObject;
  };
  const std::string directory = writeScene(without("n_frames: 2\n"));
  std::filesystem::create_directories(directory + "/frames");
  for (int k = 0; k < 3; ++k) std::ofstream(directory + "/" + numbered("frames/%06d.jpg", k));
  const Scene scene = loadScene(directory + "/");
  std::filesystem::remove_all(directory + "/frames");
  EXPECT_EQ(scene.name, "scene");
  EXPECT_EQ(scene.frame_count, 3);
  EXPECT_EQ(scene.framePath(12), scene.directory + "/frames/000012.jpg");
}

TEST(Scene, aGapAmongTheFramesIsNamed) {
  std::string yaml = kHead + kPose + kObject;
  yaml.erase(yaml.find("n_frames: 2\n"), 12);
  const std::string folder = testing::TempDir() + "scene/frames";
  const auto errorWith = [&](const std::vector<int>& there, const std::string& pattern) {
    for (const int k : there) {
      const std::filesystem::path file = folder + "/../" + numbered(pattern, k);
      std::filesystem::create_directories(file.parent_path());
      std::ofstream(file.string());
    }
    const std::string error = errorOf(yaml + "frames: " + pattern + "\n");
    std::filesystem::remove_all(folder);
    return error;
  };
  const std::string first = errorWith({1, 2}, "frames/%06d.jpg");  // as ffmpeg numbers them
  EXPECT_NE(first.find("000000.jpg, though frames/000001.jpg"), std::string::npos) << first;
  EXPECT_NE(first.find("from 0"), std::string::npos) << first;
  const std::string third = errorWith({0, 1, 12, 4}, "frames/f%d.jpg");
  EXPECT_NE(third.find("f2.jpg, though frames/f4.jpg"), std::string::npos) << third;
  const std::string folders = errorWith({0, 2}, "frames/%d/left.jpg");
  EXPECT_NE(folders.find("1/left.jpg, though frames/2/left.jpg"), std::string::npos) << folders;
  EXPECT_EQ(errorWith({0, 1}, "frames/%06d.jpg"), "");
  EXPECT_EQ(errorWith({}, "frames/%06d.jpg"), "");  // the frames can come from a bag
}

TEST(Scene, aRectangleMeetsThePicture) {
  const std::string drawn = "[3, 4, 20, 10]";
  const auto errorWith = [&](const std::string& rect) {
    std::string yaml = kHead + kPose + kObject;
    return errorOf(yaml.replace(yaml.find(drawn), drawn.size(), rect));
  };
  for (const char* outside : {"[64, 4, 20, 10]", "[3, -10, 20, 10]"}) {
    const std::string error = errorWith(outside);
    for (const char* part : {"'ball': rect_xywh", "picture of 64x36", "first frame"})
      EXPECT_NE(error.find(part), std::string::npos) << outside << ": " << error;
  }
  EXPECT_NE(errorWith("[3, 4, 0, 10]").find("no area"), std::string::npos);
  EXPECT_EQ(errorWith("[-5, -9, 20, 10]"), "");  // cut off by the picture's edge
}

// What is clear of all planes would else be taken to fall.
TEST(Scene, planesAreNotTheOnlySupportsBesideAMesh) {
  const std::string yaml = kHead + kPose + kObject + "support:\n- {plane: [0, 0, 1, 0]}\n";
  EXPECT_EQ(loadScene(writeScene(yaml)).onlySupports().size(), 1u);
  EXPECT_TRUE(loadScene(writeScene(yaml + "- {mesh: deck.obj}\n")).onlySupports().empty());
}

TEST(Scene, aPointAheadProjectsToThePrincipalPoint) {
  const Camera camera = loadScene(writeScene(kHead + kPose + kObject)).camera;
  EXPECT_TRUE(camera.projectWorld({0, 3, 1}).isApprox(Eigen::Vector2d(31.5, 17.5), 1e-12));
}

TEST(Scene, theCameraStandsWhereItsPathHasItAndStaysAtTheEnd) {
  const Scene still = loadScene(writeScene(kHead + kPose + kObject));
  EXPECT_EQ(still.cameraAt(1).world_from_camera.translation(), Eigen::Vector3d(0, -2, 1));
  const Scene scene =
      loadScene(writeScene(kHead + kPose + kObject + "world_T_camera_per_frame:\n" +
                           "- [[1, 0, 0, 0], [0, 0, 1, -2], [0, -1, 0, 1], [0, 0, 0, 1]]\n" +
                           "- [[1, 0, 0, 3], [0, 0, 1, -2], [0, -1, 0, 1], [0, 0, 0, 1]]\n"));
  EXPECT_EQ(scene.cameraAt(0).world_from_camera.translation(), Eigen::Vector3d(0, -2, 1));
  EXPECT_EQ(scene.cameraAt(1).world_from_camera.translation(), Eigen::Vector3d(3, -2, 1));
  EXPECT_EQ(scene.cameraAt(7).world_from_camera.translation(), Eigen::Vector3d(3, -2, 1));
  EXPECT_DOUBLE_EQ(scene.cameraAt(1).fx, scene.camera.fx);
}

TEST(Camera, projectJacobianMatchesFiniteDifferences) {
  Camera camera;
  camera.fx = 700;
  camera.fy = 650;
  const Eigen::Vector3d p(0.2, -0.1, 1.3);
  const auto J = camera.projectJacobian(p);
  constexpr double kStep = 1e-6;  // truncation ~ step^2 * f / z^3
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d d = kStep * Eigen::Vector3d::Unit(i);
    const Eigen::Vector2d slope = (camera.project(p + d) - camera.project(p - d)) / (2 * kStep);
    EXPECT_TRUE(slope.isApprox(J.col(i), 1e-6) || (slope - J.col(i)).norm() < 1e-5);
  }
}

TEST(Scene, badInputNamesKeyAndRemedy) {
  const auto expect = [](const std::string& yaml, const std::string& part) {
    EXPECT_NE(errorOf(yaml).find(part), std::string::npos) << errorOf(yaml);
  };
  expect("name: desk\n" + kPose + kObject, "fps is missing");
  expect("name: desk\nfps: -30\n" + kPose + kObject, "fps is -30; it must be > 0 Hz");
  expect(kHead + kObject, "world_T_camera is missing");
  expect(kHead + kPose, "objects is empty");
  expect(kHead + kPose + kObject + "frames: frames/%s.jpg\n", "exactly one integer field");
  expect(kHead + kPose + kObject + "distortion: [0.1, 0, 0, 0, 0]\n", "undistort");
  expect(kHead + "world_T_camera: [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n",
         "not a rigid transform");
  expect(kHead + kPose + "objects: {ball: {index: 1}}\n", "scene.yaml: objects is '{ball");
  expect(kHead + kPose + kObject + "camera_moving: maybe\n", "it must be true or false");
  expect(kHead + kPose + kObject + "support: {plane: [0, 0, 1, 0]}\n", "it must be a list");
  expect(kHead + kPose + kObject + "support: floor.obj\n", "support is 'floor.obj'");
  expect(kHead + kPose + kObject + "support: [floor.obj]\n", "mesh: FILE");
  expect(kHead + kPose + kObject + "attachment_hints: {ball: {box_min: [0, 0, 0]}}\n",
         "attachment_hints: ball is");
  expect(kHead + kPose + kObject + "attachment_hints: {bal: []}\n", "known ones are ball");
  expect(kHead + kPose + kObject + "attachment_hints: [ball]\n", "objects' names");
  expect(kHead + kPose + kObject + "strokes: {file: scribble.png}\n", "scribble.png");
  EXPECT_THROW(loadScene("/nowhere"), std::runtime_error);
}

TEST(Scene, unknownObjectNamesTheKnownOnes) {
  const Scene scene = loadScene(writeScene(kHead + kPose + kObject));
  try {
    scene.object("cube");
    FAIL() << "no error";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("it has: ball"), std::string::npos);
  }
}

}  // namespace
}  // namespace calipso

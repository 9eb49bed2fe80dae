#include "calipso_bag/rviz_view.hpp"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cmath>

#include "temporary_folder.hpp"

namespace calipso::bag {
namespace {

// A cube of side `size` at (0, 3, 1) x size, looked at along +y from the world's origin.
Scene sceneOf(double size, const TemporaryFolder& folder) {
  TriangleMesh cube;
  cube.vertices.resize(8, 3);
  for (int i = 0; i < 8; ++i)
    cube.vertices.row(i) = size * Eigen::RowVector3d(i % 2 - 0.5, i / 2 % 2 - 0.5, i / 4 - 0.5);
  cube.triangles.resize(12, 3);
  cube.triangles << 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6,
      0, 6, 2, 1, 3, 7, 1, 7, 5;
  saveObj(cube, folder / "cube.obj");
  Scene scene;
  scene.camera.world_from_camera.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  SceneObject object;
  object.cad_path = folder / "cube.obj";
  object.initial_world_from_object.translation() = size * Eigen::Vector3d(0.0, 3.0, 1.0);
  scene.objects = {object};
  return scene;
}

constexpr char kConfig[] =
    "Visualization Manager:\n"
    "  Displays:\n"
    "    - {Class: rviz/Grid, Cell Size: 0.1}\n"
    "    - {Class: rviz/TF, Marker Scale: 0.1}\n"
    "    - {Class: rviz/Image, Image Topic: /calipso/image}\n"
    "  Views:\n"
    "    Current: {Class: rviz/Orbit, Distance: 1}\n";

class ViewAtScale : public ::testing::TestWithParam<double> {};

TEST_P(ViewAtScale, HoldsTheWholeScene) {
  const double size = GetParam();
  const TemporaryFolder folder;
  const YAML::Node root = YAML::Load(rvizConfigFor(sceneOf(size, folder), kConfig));
  const YAML::Node view = root["Visualization Manager"]["Views"]["Current"];
  EXPECT_NEAR(view["Focal Point"]["Y"].as<double>(), 3.0 * size, 1e-9 * size);
  EXPECT_NEAR(view["Focal Point"]["Z"].as<double>(), 1.0 * size, 1e-9 * size);
  // The cube's diagonal fits into rviz's 45 degrees with little room to spare.
  const double radius = 0.5 * std::sqrt(3.0) * size, distance = view["Distance"].as<double>();
  EXPECT_GT(distance, radius / std::tan(M_PI / 8) * 0.9);
  EXPECT_LT(distance, 4.0 * radius);
  EXPECT_LT(view["Near Clip Distance"].as<double>(), distance - radius);
  // From the camera's side: it stands towards -y.
  EXPECT_LT(std::sin(view["Yaw"].as<double>()), -0.8);

  const YAML::Node displays = root["Visualization Manager"]["Displays"];
  const auto cell = displays[0]["Cell Size"].as<double>();
  EXPECT_GT(cell, 0.05 * size);
  EXPECT_LT(cell, size);
  EXPECT_NEAR(displays[0]["Offset"]["Z"].as<double>(), 0.5 * size, 1e-9 * size);
  EXPECT_NEAR(displays[1]["Marker Scale"].as<double>(), 0.3 * radius, 1e-9 * size);
  EXPECT_EQ(displays[2]["Image Topic"].as<std::string>(), "/calipso/image");
}

INSTANTIATE_TEST_SUITE_P(Sizes, ViewAtScale, ::testing::Values(0.02, 1.0, 300.0));

// Where a thing that is thrown will land.
TEST(ObjectBounds, HoldTheSupportBeneathThatTheVideoShows) {
  const TemporaryFolder folder;
  Scene scene = sceneOf(1.0, folder);
  scene.camera.width = scene.camera.height = 101;
  scene.camera.cx = scene.camera.cy = 50.0;
  scene.camera.fx = scene.camera.fy = 50.0;
  EXPECT_NEAR(objectBounds(scene).min().z(), 0.5, 1e-12);
  scene.planes.resize(1);
  scene.planes[0].offset = -2.0;
  EXPECT_NEAR(objectBounds(scene).min().z(), -2.0, 1e-12);
  scene.planes[0].offset = -1000.0;
  EXPECT_NEAR(objectBounds(scene).min().z(), 0.5, 1e-12);
}

TEST(OrbitView, StaysAboveAndDoesNotTurnOver) {
  const Eigen::AlignedBox3d bounds(Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones());
  Eigen::Isometry3d camera = Eigen::Isometry3d::Identity();  // looks along +z: up
  EXPECT_GT(orbitView(bounds, camera).pitch, 0.0);
  camera.linear() << 1, 0, 0, 0, -1, 0, 0, 0, -1;  // down
  EXPECT_LT(orbitView(bounds, camera).pitch, M_PI / 2);
}

TEST(RvizConfig, OneWithoutAViewIsRefused) {
  const TemporaryFolder folder;
  EXPECT_EQ(messageOf([&] { rvizConfigFor(sceneOf(1.0, folder), "Panels: []"); }),
            "the configuration has no view");
}

}  // namespace
}  // namespace calipso::bag

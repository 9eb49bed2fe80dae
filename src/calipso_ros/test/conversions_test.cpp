#include "calipso_ros/conversions.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace calipso {
namespace {

Eigen::Isometry3d somePose() {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  pose.translation() = Eigen::Vector3d(4, 5, 6);
  return pose;
}

TEST(Conversions, stampsKeepEveryNanosecond) {
  EXPECT_EQ(nanoseconds(ros::Time(1700000000, 123456789)), 1700000000123456789);
}

TEST(Conversions, posesRoundTrip) {
  constexpr double kRoundOff = 1e-14;  // matrix -> quaternion -> matrix
  EXPECT_TRUE(fromMsg(toMsg(somePose())).isApprox(somePose(), kRoundOff));
  EXPECT_TRUE(fromMsg(toTransformMsg(somePose())).isApprox(somePose(), kRoundOff));
}

TEST(Conversions, aZeroQuaternionIsRefused) {
  EXPECT_THROW(fromMsg(geometry_msgs::Pose()), std::invalid_argument);
}

TEST(Conversions, camerasRoundTrip) {
  Camera camera;
  camera.width = 640;
  camera.height = 360;
  camera.fx = 760;
  camera.fy = 761;
  camera.cx = 319.5;
  camera.cy = 179.5;
  const Camera again = fromMsg(toMsg(camera), somePose());
  EXPECT_EQ(again.width, 640);
  EXPECT_EQ(again.height, 360);
  EXPECT_EQ(again.fx, 760);
  EXPECT_EQ(again.fy, 761);
  EXPECT_EQ(again.cx, 319.5);
  EXPECT_EQ(again.cy, 179.5);
}

// image_proc publishes no camera_info of its own: D and K are the raw images', P is the others'.
TEST(Conversions, aCameraInfoTellsOfRectifiedImagesToo) {
  Camera straight;
  straight.width = straight.height = 10;
  straight.fx = 8, straight.fy = 9, straight.cx = 4.5, straight.cy = 5.5;
  sensor_msgs::CameraInfo info = toMsg(straight);
  info.K[0] = info.K[4] = 12.0, info.K[2] = 3.0;
  info.D[0] = -0.3;
  EXPECT_THROW(fromMsg(infoOfTopic("/camera/image_raw", info), somePose()), std::invalid_argument);
  const Camera seen = fromMsg(infoOfTopic("/camera/image_rect_color", info), somePose());
  EXPECT_EQ(seen.fx, 8);
  EXPECT_EQ(seen.fy, 9);
  EXPECT_EQ(seen.cx, 4.5);
  EXPECT_EQ(seen.cy, 5.5);
}

TEST(Conversions, uncalibratedAndDistortedCamerasAreRefused) {
  sensor_msgs::CameraInfo info;
  EXPECT_THROW(fromMsg(info, somePose()), std::invalid_argument);
  Camera camera;
  camera.width = camera.height = 10;
  camera.fx = camera.fy = 10;
  info = toMsg(camera);
  info.D[0] = 0.1;
  EXPECT_THROW(fromMsg(info, somePose()), std::invalid_argument);
  info = toMsg(camera);
  EXPECT_NO_THROW(fromMsg(info, somePose()));
  info.K[2] = std::nan("");
  EXPECT_THROW(fromMsg(info, somePose()), std::invalid_argument);
}

TEST(Conversions, meshesRoundTripAndBadOnesAreRefused) {
  TriangleMesh mesh;
  mesh.vertices.setRandom(4, 3);
  mesh.triangles.resize(2, 3);
  mesh.triangles << 0, 1, 2, 1, 3, 2;
  calipso_msgs::Mesh msg = toMsg(mesh);
  EXPECT_EQ(fromMsg(msg).vertices, mesh.vertices);
  EXPECT_EQ(fromMsg(msg).triangles, mesh.triangles);
  msg.triangles[0] = 4;
  EXPECT_THROW(fromMsg(msg), std::invalid_argument);
}

TEST(Conversions, editsRoundTrip) {
  Edit edit;
  edit.time = 0.5;
  edit.object = "banana1";
  edit.kind = EditKind::kPull;
  edit.mode = EditMode::kTarget;
  edit.region.kind = RegionKind::kPixel;
  edit.region.pixel = {3, 4};
  edit.region.point = {1, 2, 3};
  edit.region.radius = 0.5;
  edit.region.box_min = {4, 5, 6};
  edit.region.box_max = {7, 8, 9};
  edit.vector = {1, 2, 3};
  edit.angular = {4, 5, 6};
  edit.translation = {7, 8, 9};
  edit.rotation = Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized());
  edit.scale = 1.5;
  edit.factor = 2.5;
  edit.ramp = 0.25;
  edit.duration = 0.75;
  const Edit again = fromMsg(toMsg(edit, ros::Time(7)), ros::Time(7));
  EXPECT_NEAR(again.time, 0.5, 1e-9);  // stamps hold nanoseconds
  EXPECT_EQ(again.object, edit.object);
  EXPECT_EQ(again.kind, edit.kind);
  EXPECT_EQ(again.mode, edit.mode);
  EXPECT_EQ(again.region.kind, edit.region.kind);
  EXPECT_EQ(again.region.pixel, edit.region.pixel);
  EXPECT_EQ(again.region.point, edit.region.point);
  EXPECT_EQ(again.region.radius, edit.region.radius);
  EXPECT_EQ(again.region.box_min, edit.region.box_min);
  EXPECT_EQ(again.region.box_max, edit.region.box_max);
  EXPECT_EQ(again.vector, edit.vector);
  EXPECT_EQ(again.angular, edit.angular);
  EXPECT_EQ(again.translation, edit.translation);
  EXPECT_TRUE(again.rotation.isApprox(edit.rotation, 1e-14));
  EXPECT_EQ(again.scale, edit.scale);
  EXPECT_EQ(again.factor, edit.factor);
  EXPECT_EQ(again.ramp, edit.ramp);
  EXPECT_EQ(again.duration, edit.duration);
  EXPECT_TRUE(std::isnan(again.youngs_modulus));
}

TEST(Conversions, whatTheKindsNeedRoundTrips) {
  Edit edit;
  edit.kind = EditKind::kContact;
  edit.other = "table";
  edit.meet = false;
  edit.friction = 0.0;
  edit.color = {0.25, 0.5, 1.0};
  edit.after = "cup";
  edit.collision = 2;
  edit.pressure = -3.0;
  edit.specular = 0.25;
  edit.roughness = 0.75;
  Edit again = fromMsg(toMsg(edit, ros::Time(1)), ros::Time(1));
  EXPECT_EQ(again.other, "table");
  EXPECT_FALSE(again.meet);
  EXPECT_NEAR(again.friction, 0.0, 1e-300);
  EXPECT_TRUE(std::isnan(again.restitution));
  EXPECT_EQ(again.color, edit.color);
  EXPECT_EQ(again.after, "cup");
  EXPECT_EQ(again.collision, 2);
  EXPECT_EQ(again.pressure, -3.0);
  EXPECT_EQ(again.specular, 0.25);
  EXPECT_EQ(again.roughness, 0.75);
  edit.color.setZero();  // black
  EXPECT_NEAR(fromMsg(toMsg(edit, ros::Time(1)), ros::Time(1)).color.norm(), 0.0, 1e-30);
  edit.kind = EditKind::kDuplicate;
  edit.new_name = "twin";
  EXPECT_EQ(fromMsg(toMsg(edit, ros::Time(1)), ros::Time(1)).new_name, "twin");
  edit.kind = EditKind::kInsert;
  edit.model_path = "cad/ball.obj";
  again = fromMsg(toMsg(edit, ros::Time(1)), ros::Time(1));
  EXPECT_EQ(again.new_name, "twin");
  EXPECT_EQ(again.model_path, "cad/ball.obj");
}

TEST(Conversions, aMeantZeroSurvivesAndAMissingNumberIsUnchanged) {
  Edit edit;
  edit.kind = EditKind::kMaterial;
  edit.damping = 0.0;
  edit.youngs_modulus = 2e4;
  const Edit again = fromMsg(toMsg(edit, ros::Time(1)), ros::Time(1));
  EXPECT_EQ(again.youngs_modulus, 2e4);
  EXPECT_NEAR(again.damping, 0.0, 1e-300);
  EXPECT_TRUE(std::isnan(again.poissons_ratio));
  EXPECT_TRUE(std::isnan(again.density));
}

TEST(Conversions, anEditWithOnlyANameMeansNowAndUnchanged) {
  calipso_msgs::Edit msg;
  msg.kind = calipso_msgs::Edit::REMOVE;
  const Edit edit = fromMsg(msg, ros::Time(1));
  EXPECT_LT(edit.time, 0.0);
  EXPECT_EQ(edit.scale, 1.0);
  EXPECT_TRUE(edit.rotation.isApprox(Eigen::Quaterniond::Identity()));
  EXPECT_EQ(edit.region.kind, RegionKind::kAll);
}

}  // namespace
}  // namespace calipso

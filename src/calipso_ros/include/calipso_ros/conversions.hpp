#pragma once

#include <calipso_msgs/Edit.h>
#include <calipso_msgs/Mesh.h>
#include <geometry_msgs/Point.h>
#include <geometry_msgs/Pose.h>
#include <geometry_msgs/Transform.h>
#include <geometry_msgs/Vector3.h>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>

#include <Eigen/Geometry>
#include <cstdint>

#include "calipso_scene/camera.hpp"
#include "calipso_scene/edit.hpp"
#include "calipso_scene/triangle_mesh.hpp"

// Pure functions between messages and the plain types of calipso_scene. Each fromMsg undoes its
// toMsg.
namespace calipso {

// As the cores hold stamps: counted from ROS time 0.
std::int64_t nanoseconds(const ros::Time& stamp);

geometry_msgs::Point toPointMsg(const Eigen::Vector3d& p);
geometry_msgs::Vector3 toVectorMsg(const Eigen::Vector3d& v);
Eigen::Vector3d fromMsg(const geometry_msgs::Point& p);
Eigen::Vector3d fromMsg(const geometry_msgs::Vector3& v);

geometry_msgs::Pose toMsg(const Eigen::Isometry3d& pose);
geometry_msgs::Transform toTransformMsg(const Eigen::Isometry3d& pose);
// @throw std::invalid_argument if the quaternion is zero or a number is not finite
Eigen::Isometry3d fromMsg(const geometry_msgs::Pose& pose);
Eigen::Isometry3d fromMsg(const geometry_msgs::Transform& transform);

calipso_msgs::Mesh toMsg(const TriangleMesh& mesh);
// @throw std::invalid_argument if a size is no multiple of 3 or an index is out of range
TriangleMesh fromMsg(const calipso_msgs::Mesh& mesh);

sensor_msgs::CameraInfo toMsg(const Camera& camera);  // header left empty
// What a camera_info says of the images of a topic. One and the same tells of a camera's raw images
// (D, K) and of its rectified ones, "image_rect...", as image_proc makes them (P).
sensor_msgs::CameraInfo infoOfTopic(const std::string& image_topic, sensor_msgs::CameraInfo info);
// @throw std::invalid_argument if the focal length or size is not positive, a number is not finite,
// or there is distortion
Camera fromMsg(const sensor_msgs::CameraInfo& info, const Eigen::Isometry3d& world_from_camera);

// Edit::time counts from `first_stamp`, the stamp of the clip's first frame; a message without a
// stamp means "with the next frame" (time < 0).
calipso_msgs::Edit toMsg(const Edit& edit, const ros::Time& first_stamp);
// Only converts; validate() checks ranges. @throw std::invalid_argument for an unknown name
Edit fromMsg(const calipso_msgs::Edit& edit, const ros::Time& first_stamp);

}  // namespace calipso

#pragma once

#include <calipso_msgs/AlignedModel.h>
#include <calipso_msgs/Dynamics.h>
#include <calipso_msgs/ObjectClipDynamics.h>
#include <calipso_msgs/ObjectDynamics.h>
#include <calipso_msgs/Segmentation.h>
#include <sensor_msgs/Image.h>

#include <string>
#include <vector>

#include "calipso_flow/clip_dynamics.hpp"
#include "calipso_ros/frame_source.hpp"
#include "calipso_scene/scene.hpp"

// Pure functions between messages and this package's plain types.
namespace calipso::flow {

// 8-bit BGR pixels, shared with the message where its encoding allows.
// @throw std::invalid_argument naming encoding or size and the remedy
cv::Mat pictureFromMsg(const sensor_msgs::ImageConstPtr& image);

// @throw std::invalid_argument as pictureFromMsg, or when picture and camera differ in size
Frame frameFromMsg(const calipso::Frame& frame);

// @param scene  says where the object is attached
ObjectModel modelFromMsg(const calipso_msgs::AlignedModel& model, const Scene& scene);

// 255 where the label image shows the object. @throw std::invalid_argument unless it is mono8
cv::Mat maskFromMsg(const sensor_msgs::Image& labels, int index);

calipso_msgs::ObjectDynamics toMsg(const std::string& object, const ObjectMotion& motion);

// Adds the deformation at frame `index` of the clip.
void addDeformation(const DeformationMotion& deformation, int index,
                    calipso_msgs::ObjectDynamics& msg);

// @param amplitudes, velocities  of the object's modes, m, m/s
void addModes(const Eigen::VectorXd& amplitudes, const Eigen::VectorXd& velocities,
              calipso_msgs::ObjectDynamics& msg);
// Adds the wind at a time, s, where the deformation shows one.
void addWind(const DeformationMotion& deformation, double time, calipso_msgs::ObjectDynamics& msg);

// What the whole clip says about one object; times are seconds of ROS time.
calipso_msgs::ObjectClipDynamics toMsg(const ObjectDynamics& object);

// What is said about an object of which nothing is known but its rough placement.
calipso_msgs::ObjectDynamics withoutEstimate(const SceneObject& object);

// CV_32FC2 as 32FC2, px per frame.
sensor_msgs::Image flowToMsg(const cv::Mat& flow, const std_msgs::Header& header);

}  // namespace calipso::flow

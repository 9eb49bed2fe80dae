#pragma once

#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/DeformationMode.h>
#include <calipso_msgs/EditReport.h>
#include <calipso_msgs/ObjectDynamics.h>
#include <calipso_msgs/Plan.h>
#include <calipso_msgs/SimulationState.h>
#include <calipso_msgs/Wind.h>
#include <ros/time.h>

#include <vector>

#include "calipso_fem/world/observed_wind.hpp"
#include "calipso_fem/world/world_types.hpp"
#include "calipso_scene/scene.hpp"

// Between messages and the simulator's plain types.
namespace calipso::fem {

// What the user gives and what the alignment found. @throw std::invalid_argument for a broken model
WorldScene toWorldScene(const Scene& scene, const calipso_msgs::AlignedModels& models);

// time: s since the first frame. @throw std::invalid_argument for a broken pose
ObservedMotion fromMsg(const calipso_msgs::ObjectDynamics& dynamics, double time);

ObservedWind fromMsg(const calipso_msgs::Wind& wind, const ros::Time& first_stamp);

// One column per mode. @throw std::invalid_argument when their lengths differ
Eigen::MatrixXd shapesOf(const std::vector<calipso_msgs::DeformationMode>& modes);

calipso_msgs::SimulationState toMsg(const WorldState& state, const ros::Time& stamp);
calipso_msgs::Plan toMsg(const std::vector<PlanEntry>& plan, const ros::Time& stamp);
calipso_msgs::EditReport toMsg(const EditOutcome& outcome, const ros::Time& stamp,
                               const ros::Time& first_stamp);

}  // namespace calipso::fem

#pragma once

#include <vector>

#include "calipso_flow/frame.hpp"
#include "calipso_flow/motion_filter.hpp"
#include "calipso_flow/object_tracker.hpp"

namespace calipso::flow {

// How one object moves at one frame. World axes.
struct ObjectMotion {
  bool moving = false;  // false: at rest within its uncertainty
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();
  MotionState state;  // of the centroid
  int tracks = 0;     // inliers in this frame; 0: the state is carried over from other frames
};

// @param centroid  object frame, m
ObjectMotion motionFrom(const MotionState& state, const Eigen::Vector3d& centroid, bool moving,
                        int tracks);

// Pose measurements of an object's centroid.
std::vector<PoseMeasurement> measurementsOf(const std::vector<Observation>& observations,
                                            const Eigen::Vector3d& centroid);

// True when `next` does not continue `previous`: the video was cut between them. Judged without the
// frames after, as live video must be; calipso_bag's ShotChanges, which warns of cuts in a whole
// bag, has them.
bool isCut(const Frame& previous, const Frame& next, double least_correlation);

// Deviations of the motion prior for an object seen at `depth` metres: fast enough to cross the
// picture in a tenth of a second.
MotionPrior priorFor(const Camera& camera, double depth, const Eigen::Vector3d& gravity);

}  // namespace calipso::flow

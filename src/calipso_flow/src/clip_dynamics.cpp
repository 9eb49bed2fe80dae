#include "calipso_flow/clip_dynamics.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

namespace calipso::flow {

namespace {

// Largest image motion of the object's followed points between the first state and any other, px,
// were the camera at rest.
double largestImageMotion(const std::vector<MotionState>& states, const Camera& camera,
                          const ObjectTracker& tracker) {
  const Eigen::Isometry3d first =
      motionFrom(states.front(), tracker.centroid(), false, 0).world_from_object;
  double largest = 0.0;
  for (const MotionState& state : states) {
    const Eigen::Isometry3d pose =
        motionFrom(state, tracker.centroid(), false, 0).world_from_object;
    for (const Track& track : tracker.keyObservation().tracks) {
      const Eigen::Vector2d moved = camera.projectWorld(pose * track.point) -
                                    camera.projectWorld(first * track.point);
      largest = std::max(largest, moved.norm());
    }
  }
  return largest;
}

// Relative deviation of the object's distance from the camera, as the alignment states it. What is
// twice as far moves twice as fast: every velocity carries it.
double scaleDeviation(const ObjectModel& model, const Eigen::Vector3d& position,
                      const Camera& camera) {
  const Eigen::Vector3d sight = position - camera.world_from_camera.translation();
  const Eigen::Vector3d direction = sight.normalized();
  const double variance = direction.dot(model.position_covariance * direction);
  return variance > 0.0 ? std::sqrt(variance) / sight.norm() : 0.0;
}

}  // namespace

std::string summary(const std::vector<ObjectDynamics>& objects) {
  std::string text;
  for (const ObjectDynamics& object : objects) {
    const Trajectory& trajectory = object.trajectory;
    const bool moves = std::any_of(object.motions.begin(), object.motions.end(),
                                   [](const ObjectMotion& m) { return m.moving; });
    text += (text.empty() ? "" : "; ") + object.name + (moves ? " moves" : " at rest");
    char number[64];
    if (!trajectory.collisions.empty()) {
      std::snprintf(number, sizeof number, ", %zu collisions from %.3f s",
                    trajectory.collisions.size(), trajectory.collisions.front().time);
      text += number;
    }
    if (trajectory.gravity) {
      std::snprintf(number, sizeof number, ", falls with %.2f +- %.2f m/s^2",
                    trajectory.gravity->acceleration.norm(), trajectory.gravity->deviation);
      text += number;
    }
  }
  return text;
}

ClipAnalyser::ClipAnalyser(const Frame& key_frame, const std::vector<ObjectModel>& models,
                           const std::vector<cv::Mat>& masks, const Eigen::Vector3d& gravity,
                           const DynamicsParams& params)
    : params_(params), gravity_(gravity), last_(key_frame), times_{key_frame.time} {
  if (models.size() != masks.size()) {
    throw std::invalid_argument("clip analyser: " + std::to_string(models.size()) +
                                " models but " + std::to_string(masks.size()) +
                                " masks; give one mask (or an empty one) per model");
  }
  for (size_t i = 0; i < models.size(); ++i) {
    trackers_.emplace_back(models[i], key_frame, masks[i], params.tracker);
    observations_.push_back({trackers_.back().keyObservation()});
  }
}

void ClipAnalyser::add(const Frame& frame) {
  if (!(frame.time > times_.back())) {
    throw std::invalid_argument("clip analyser: frame " + std::to_string(times_.size()) + " at " +
                                std::to_string(frame.time) +
                                " s is not later than the one before (" +
                                std::to_string(times_.back()) + " s); give frames in order of time");
  }
  const bool cut = isCut(last_, frame, params_.cut_correlation);
  if (cut) cut_times_.push_back(0.5 * (times_.back() + frame.time));
  for (size_t i = 0; i < trackers_.size(); ++i) {
    observations_[i].push_back(trackers_[i].track(frame, cut));
  }
  times_.push_back(frame.time);
  last_ = frame;
}

std::vector<ObjectDynamics> ClipAnalyser::finish() const {
  std::vector<ObjectDynamics> result(trackers_.size());
  for (size_t i = 0; i < trackers_.size(); ++i) result[i] = finishObject(i);
  return result;
}

ObjectDynamics ClipAnalyser::finishObject(size_t index) const {
  const ObjectTracker& tracker = trackers_[index];
  ObjectDynamics dynamics;
  dynamics.name = tracker.model().name;
  dynamics.diagonal = boundingDiagonal(tracker.model().mesh);
  dynamics.observations = observations_[index];
  const auto measurements = measurementsOf(dynamics.observations, tracker.centroid());
  const Camera& camera = last_.camera;
  const double depth =
      (camera.world_from_camera.inverse() * measurements.front().position).norm();
  TrajectoryParams trajectory = params_.trajectory;
  trajectory.still = [&](const std::vector<MotionState>& states) {
    return largestImageMotion(states, camera, tracker) < params_.rest_px;
  };
  dynamics.trajectory =
      fitTrajectory(measurements, cut_times_, priorFor(camera, depth, gravity_), trajectory);
  const double scale = scaleDeviation(tracker.model(), measurements.front().position, camera);
  for (size_t k = 0; k < measurements.size(); ++k) {
    dynamics.trajectory.states[k].addScaleUncertainty(scale);
    dynamics.motions.push_back(motionFrom(dynamics.trajectory.states[k], tracker.centroid(),
                                          dynamics.trajectory.movingAt(measurements[k].time),
                                          dynamics.observations[k].inliers()));
  }
  dynamics.motions.front().world_from_object = tracker.model().world_from_object;
  return dynamics;
}

}  // namespace calipso::flow

#include "calipso_flow/clip_dynamics.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <opencv2/core/utility.hpp>
#include <stdexcept>

#include "calipso_flow/rotation.hpp"
#include "support_contact.hpp"

namespace calipso::flow {

namespace {

// Image motion between the first state and the farthest other one, px, for the camera of the other,
// were that at rest: the mean over the object's followed points, as far as they are before it, since
// errors of the pose are largest at single points far out.
// @param times, cameras  per frame
double largestImageMotion(const std::vector<MotionState>& states, const std::vector<double>& times,
                          const std::vector<Camera>& cameras, const ObjectTracker& tracker) {
  const std::vector<Track>& tracks = tracker.keyObservation().tracks;
  const Eigen::Isometry3d first =
      motionFrom(states.front(), tracker.centroid(), false, 0).world_from_object;
  double largest = 0.0;
  for (const MotionState& state : states) {
    const Eigen::Isometry3d pose =
        motionFrom(state, tracker.centroid(), false, 0).world_from_object;
    const auto frame = std::lower_bound(times.begin(), times.end(), state.time);
    const Camera& camera = cameras.at(frame - times.begin());
    const Eigen::Isometry3d camera_from_world = camera.world_from_camera.inverse();
    double sum = 0.0;
    int seen = 0;
    for (const Track& track : tracks) {
      const Eigen::Vector3d now = camera_from_world * (pose * track.point),
                            then = camera_from_world * (first * track.point);
      if (now.z() <= 0.0 || then.z() <= 0.0) continue;
      sum += (camera.project(now) - camera.project(then)).norm();
      ++seen;
    }
    largest = std::max(largest, sum / std::max(1, seen));
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

// Of the velocity: the alignment places the centre of mass only so well in the body, and it goes
// round with its spin.
Matrix6d offCentre(const ObjectModel& model, const MotionState& state) {
  const Eigen::Matrix3d round = skew(state.spin);
  const Eigen::Matrix3d turned = state.rotation * model.world_from_object.linear().transpose();
  Matrix6d twist = Matrix6d::Zero();
  twist.topLeftCorner<3, 3>() =
      round * turned * model.position_covariance * turned.transpose() * round.transpose();
  return twist;
}

// Of the velocity: what is not seen may have met something. A force of its weight, for as long as
// since it was seen, or until it is seen again.
Matrix6d unseen(const std::vector<PoseMeasurement>& measurements, double time,
                const Eigen::Vector3d& gravity) {
  double apart = std::numeric_limits<double>::infinity();  // s
  for (const PoseMeasurement& m : measurements)
    if (m.valid) apart = std::min(apart, std::abs(m.time - time));
  Matrix6d twist = Matrix6d::Zero();
  twist.diagonal().head<3>().setConstant(apart * apart * gravity.squaredNorm());
  return twist;
}

std::string motionText(const ObjectDynamics& object) {
  const size_t frames = object.observations.size();
  const size_t seen = std::count_if(object.observations.begin(), object.observations.end(),
                                    [](const Observation& o) { return o.found; });
  const bool moves = std::any_of(object.motions.begin(), object.motions.end(),
                                 [](const ObjectMotion& m) { return m.moving; });
  const std::string share = std::to_string(seen) + " of " + std::to_string(frames) + " frames";
  if (2 * seen >= frames) return moves ? " moves" : " at rest";
  // What is seen in a few frames only is not known to rest in the others.
  return (moves ? " moves, seen in " : " not followed: seen in ") + share;
}

std::string summaryOf(const DeformationMotion& deformation) {
  char text[160];
  std::string result = ", deforms";
  for (const SurfaceLine& line : deformation.lines) {
    std::snprintf(text, sizeof text, ", %.3f +- %.3f Hz%s", line.line.frequency,
                  line.line.deviation, line.wave_vector.isZero() ? "" : " travelling");
    result += text;
  }
  if (deformation.wind) {
    const Eigen::Vector3d& w = deformation.wind->mean;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(deformation.wind->mean_covariance);
    const Eigen::Vector3d deviations = axes.eigenvalues().cwiseSqrt(),
                          blind = axes.eigenvectors().col(2);
    std::snprintf(text, sizeof text,
                  ", wind (%.1f, %.1f, %.1f) +- %.1f m/s, but +- %.1f along (%.2f, %.2f, %.2f)",
                  w.x(), w.y(), w.z(), deviations[1], deviations[2], blind.x(), blind.y(),
                  blind.z());
    result += text;
  }
  if (deformation.stiffness) {
    std::snprintf(text, sizeof text, ", proposed E/rho %.4g +- %.2g m^2/s^2",
                  deformation.stiffness->value, deformation.stiffness->deviation);
    result += text;
  }
  return result + (deformation.note.empty() ? "" : " (" + deformation.note + ")");
}

}  // namespace

std::string summary(const std::vector<ObjectDynamics>& objects) {
  std::string text;
  for (const ObjectDynamics& object : objects) {
    const Trajectory& trajectory = object.trajectory;
    text += (text.empty() ? "" : "; ") + object.name + motionText(object);
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
    if (object.deformation) text += summaryOf(*object.deformation);
  }
  return text;
}

ClipAnalyser::ClipAnalyser(const Frame& key_frame, const std::vector<ObjectModel>& models,
                           const std::vector<cv::Mat>& masks, const Eigen::Vector3d& gravity,
                           const DynamicsParams& params)
    : params_(params),
      gravity_(gravity),
      last_(key_frame),
      times_{key_frame.time},
      cameras_{key_frame.camera} {
  if (models.size() != masks.size()) {
    throw std::invalid_argument("clip analyser: " + std::to_string(models.size()) + " models but " +
                                std::to_string(masks.size()) +
                                " masks; give one mask (or an empty one) per model");
  }
  params_.tracker.gravity = gravity;
  for (size_t i = 0; i < models.size(); ++i) {
    objects_.emplace_back(models[i], key_frame, masks[i], params_.tracker, params.rest_px);
  }
}

void ClipAnalyser::add(const Frame& frame) {
  if (!(frame.time > times_.back())) {
    throw std::invalid_argument(
        "clip analyser: frame " + std::to_string(times_.size()) + " at " +
        std::to_string(frame.time) + " s is not later than the one before (" +
        std::to_string(times_.back()) + " s); give frames in order of time");
  }
  const bool cut = isCut(last_, frame, params_.cut_correlation);
  if (cut) cut_times_.push_back(0.5 * (times_.back() + frame.time));
  recent_.push_back(frame);
  if (recent_.size() > FollowedObject::kLookBack) recent_.pop_front();
  forEachObject([&](size_t i) { objects_[i].follow(recent_, cut, cut_times_); });
  times_.push_back(frame.time);
  cameras_.push_back(frame.camera);
  last_ = frame;
}

// Objects do not know of each other: however many threads, the result is the same.
void ClipAnalyser::forEachObject(const std::function<void(size_t)>& work) const {
  cv::parallel_for_({0, static_cast<int>(objects_.size())}, [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) work(i);
  });
}

std::vector<ObjectDynamics> ClipAnalyser::finish(bool with_wind) const {
  std::vector<ObjectDynamics> result(objects_.size());
  forEachObject([&](size_t i) { result[i] = finishObject(objects_[i], with_wind); });
  return result;
}

ObjectDynamics ClipAnalyser::finishObject(const FollowedObject& object, bool with_wind) const {
  const ObjectTracker& tracker = object.tracker();
  ObjectDynamics dynamics;
  dynamics.name = tracker.model().name;
  dynamics.diagonal = boundingDiagonal(tracker.model().mesh);
  dynamics.observations = object.observations();
  if (object.deformable()) {
    dynamics.deformation =
        describeDeformation(*object.deformable(), object.deformations(), gravity_, with_wind);
    if (dynamics.deformation->modes.count() == 0) dynamics.deformation.reset();
  }
  auto measurements = measurementsOf(dynamics.observations, tracker.centroid());
  noteContacts(params_.supports, tracker.model(), dynamics.observations, gravity_, measurements);
  // All frames are compared with the key frame: its noise is an error that they share, so that it
  // is the key pose that errs against them.
  const auto first = std::find_if(measurements.begin() + 1, measurements.end(),
                                  [](const PoseMeasurement& m) { return m.valid; });
  if (first != measurements.end()) measurements.front().covariance = first->covariance;
  const Camera& camera = cameras_.front();  // the alignment's
  const double depth = (camera.world_from_camera.inverse() * measurements.front().position).norm();
  TrajectoryParams trajectory = params_.trajectory;
  if (object.deformable()) trajectory.max_collisions = 0;  // a swing is no collision
  trajectory.still = [&](const std::vector<MotionState>& states) {
    return largestImageMotion(states, times_, cameras_, tracker) < params_.rest_px;
  };
  dynamics.trajectory =
      fitTrajectory(measurements, cut_times_, priorFor(camera, depth, gravity_), trajectory);
  const double scale = scaleDeviation(tracker.model(), measurements.front().position, camera);
  Matrix6d assumed = Matrix6d::Zero();
  if (dynamics.deformation) {
    assumed = assumedTwist(*object.deformable(), object.deformations(), dynamics.deformation->modes,
                           tracker.centroid());
  }
  for (size_t k = 0; k < measurements.size(); ++k) {
    dynamics.trajectory.states[k].addScaleUncertainty(scale);
    dynamics.trajectory.states[k].addTwistCovariance(
        offCentre(tracker.model(), dynamics.trajectory.states[k]) +
        unseen(measurements, measurements[k].time, gravity_) + assumed);
    const bool moving = dynamics.deformation || dynamics.trajectory.movingAt(measurements[k].time);
    dynamics.motions.push_back(motionFrom(dynamics.trajectory.states[k], tracker.centroid(), moving,
                                          dynamics.observations[k].inliers()));
  }
  for (Collision& impact : dynamics.trajectory.collisions) {
    for (MotionState* state : {&impact.before, &impact.after})
      state->addTwistCovariance(offCentre(tracker.model(), *state));
  }
  dynamics.motions.front().world_from_object = tracker.model().world_from_object;
  return dynamics;
}

}  // namespace calipso::flow

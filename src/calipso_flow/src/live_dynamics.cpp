#include "calipso_flow/live_dynamics.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "calipso_flow/object_motion.hpp"

namespace calipso::flow {
namespace {

// Noise densities of a motion about which nothing is known, as shares of the prior's deviations.
constexpr double kJerkShare = 0.1;
constexpr double kSpinShare = 0.1;
constexpr size_t kLeastObservations = 10;  // of a window that is described
constexpr int kModes = 12;                 // of a deforming object
// Poses scatter more than the matches say, because tracks err together; measured on static scenes.
constexpr double kNoiseScale = 2.0;
// Squared surprise (6 degrees of freedom) that chance exceeds once in ten million frames.
constexpr double kCollisionSurprise = 45.0;
// Squared speed in deviations (6 degrees of freedom) below which an object counts as at rest: 99.9
// %.
constexpr double kRestSurprise = 22.5;

bool clearlyMoves(const MotionState& state) {
  Vector6d twist;
  twist << state.velocity, state.spin;
  return twist.dot(state.twistCovariance().ldlt().solve(twist)) > kRestSurprise;
}

}  // namespace

std::vector<ObjectDynamics> describe(const std::vector<DeformationWindow>& windows,
                                     const Eigen::Vector3d& gravity, bool with_wind) {
  std::vector<ObjectDynamics> objects;
  for (const DeformationWindow& window : windows) {
    if (window.observations.size() < kLeastObservations) continue;
    ObjectDynamics object;
    object.name = window.object;
    object.deformation =
        describeDeformation(*window.tracker, window.observations, gravity, with_wind);
    objects.push_back(std::move(object));
  }
  return objects;
}

LiveAnalyser::LiveAnalyser(const Frame& key_frame, const std::vector<ObjectModel>& models,
                           const std::vector<cv::Mat>& masks, const Eigen::Vector3d& gravity,
                           const DynamicsParams& params)
    : params_(params), last_(key_frame) {
  if (models.size() != masks.size()) {
    throw std::invalid_argument("live analyser: " + std::to_string(models.size()) + " models but " +
                                std::to_string(masks.size()) +
                                " masks; give one mask (or an empty one) per model");
  }
  params_.tracker.gravity = gravity;
  for (size_t i = 0; i < models.size(); ++i) {
    FollowedObject followed(models[i], key_frame, masks[i], params_.tracker, params.rest_px);
    const ObjectTracker& tracker = followed.tracker();
    const auto measurement = measurementsOf({tracker.keyObservation()}, tracker.centroid()).front();
    const Eigen::Vector3d p_camera =
        key_frame.camera.world_from_camera.inverse() * measurement.position;
    const MotionPrior prior = priorFor(key_frame.camera, p_camera.norm(), gravity);
    MotionPiece piece;
    piece.jerk = kJerkShare * prior.acceleration;
    piece.spin_noise = kSpinShare * prior.spin;
    MotionState state = initialState(key_frame.time, piece, prior, measurement);
    correct(state, measurement, kNoiseScale);
    objects_.push_back({std::move(followed), prior, piece, state, std::nullopt});
  }
}

std::vector<NamedMotion> LiveAnalyser::add(const Frame& frame) {
  if (!(frame.time > last_.time)) {
    throw std::invalid_argument("live analyser: frame at " + std::to_string(frame.time) +
                                " s is not later than the one before (" +
                                std::to_string(last_.time) + " s); give frames in order of time");
  }
  const bool cut = isCut(last_, frame, params_.cut_correlation);
  if (cut) cut_times_.push_back(0.5 * (last_.time + frame.time));
  recent_.push_back(frame);
  if (recent_.size() > FollowedObject::kLookBack) recent_.pop_front();
  last_ = frame;
  std::vector<NamedMotion> motions;
  for (Live& object : objects_) motions.push_back(follow(cut, object));
  return motions;
}

NamedMotion LiveAnalyser::follow(bool cut, Live& object) const {
  FollowedObject& followed = object.followed;
  followed.follow(recent_, cut, cut_times_);
  followed.forgetBefore(last_.time - params_.live_window);
  const Observation& observation = followed.observations().back();
  filterPose(observation, cut, object);
  const ObjectTracker& tracker = followed.tracker();
  const bool deforms = followed.deformable() != nullptr;
  NamedMotion motion{tracker.model().name,
                     motionFrom(object.state, tracker.centroid(),
                                deforms || clearlyMoves(object.state), observation.inliers())};
  if (!deforms) return motion;
  filterModes(cut, object);
  motion.mode_amplitudes = object.deforming->filter.amplitudes();
  motion.mode_velocities = object.deforming->filter.velocities();
  return motion;
}

void LiveAnalyser::filterPose(const Observation& observation, bool cut, Live& object) const {
  const Eigen::Vector3d& centroid = object.followed.tracker().centroid();
  const PoseMeasurement measurement = measurementsOf({observation}, centroid).front();
  MotionState next = predicted(object.state, measurement, object.piece, kNoiseScale);
  if (measurement.valid) {
    if (cut || squaredSurprise(next, measurement, kNoiseScale) > kCollisionSurprise) {
      MotionPiece fresh = object.piece;
      fresh.cut = cut;
      const double between = 0.5 * (object.state.time + observation.time);
      next =
          predicted(enterPiece(predicted(object.state, between, object.piece), fresh, object.prior),
                    measurement, object.piece, kNoiseScale);
    }
    correct(next, measurement, kNoiseScale);
  }
  object.state = next;
}

// An object that has just been found to deform has been looked at again in the last frames.
void LiveAnalyser::filterModes(bool cut, Live& object) {
  const DeformableTracker& tracker = *object.followed.deformable();
  const std::vector<DeformationObservation>& all = object.followed.deformations();
  size_t first = all.size() - 1;
  if (!object.deforming) {
    CoarseModes modes = coarseModesOf(tracker, kModes);
    const int count = static_cast<int>(modes.dual.cols());
    object.deforming = {std::move(modes),
                        ModeFilter(count, boundingDiagonal(tracker.model().mesh))};
    first = 0;
  }
  const Eigen::MatrixXd& dual = object.deforming->modes.dual;
  for (size_t k = first; k < all.size(); ++k) {
    if (!all[k].found) {
      object.deforming->filter.skip(all[k].time);
      continue;
    }
    const Eigen::VectorXd deviations =
        (dual.transpose() * all[k].covariance * dual).diagonal().cwiseSqrt();
    object.deforming->filter.add(all[k].time, dual.transpose() * all[k].controls, deviations,
                                 cut && k + 1 == all.size());
  }
}

std::vector<std::string> LiveAnalyser::deforming() const {
  std::vector<std::string> names;
  for (const Live& object : objects_) {
    if (object.deforming) names.push_back(object.followed.tracker().model().name);
  }
  return names;
}

const CoarseModes* LiveAnalyser::modesOf(const std::string& name) const {
  for (const Live& object : objects_) {
    if (object.deforming && object.followed.tracker().model().name == name)
      return &object.deforming->modes;
  }
  return nullptr;
}

std::vector<DeformationWindow> LiveAnalyser::windows() const {
  std::vector<DeformationWindow> windows;
  for (const Live& object : objects_) {
    if (!object.deforming) continue;
    const std::vector<DeformationObservation>& all = object.followed.deformations();
    const auto first = std::find_if(all.begin(), all.end(), [](const auto& o) { return o.found; });
    if (first == all.end()) continue;
    windows.push_back(
        {object.followed.tracker().model().name, object.followed.deformable(), {first, all.end()}});
  }
  return windows;
}

}  // namespace calipso::flow

#include "calipso_flow/live_dynamics.hpp"

#include <cmath>
#include <stdexcept>

#include "calipso_flow/object_motion.hpp"

namespace calipso::flow {
namespace {

// Noise densities of a motion about which nothing is known, as shares of the prior's deviations.
constexpr double kJerkShare = 0.1;
constexpr double kSpinShare = 0.1;
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

LiveAnalyser::LiveAnalyser(const Frame& key_frame, const std::vector<ObjectModel>& models,
                           const std::vector<cv::Mat>& masks, const Eigen::Vector3d& gravity,
                           const DynamicsParams& params)
    : params_(params), last_(key_frame) {
  if (models.size() != masks.size()) {
    throw std::invalid_argument("live analyser: " + std::to_string(models.size()) + " models but " +
                                std::to_string(masks.size()) +
                                " masks; give one mask (or an empty one) per model");
  }
  for (size_t i = 0; i < models.size(); ++i) {
    ObjectTracker tracker(models[i], key_frame, masks[i], params.tracker);
    const auto measurement = measurementsOf({tracker.keyObservation()}, tracker.centroid()).front();
    const Eigen::Vector3d p_camera =
        key_frame.camera.world_from_camera.inverse() * measurement.position;
    const MotionPrior prior = priorFor(key_frame.camera, p_camera.norm(), gravity);
    MotionPiece piece;
    piece.jerk = kJerkShare * prior.acceleration;
    piece.spin_noise = kSpinShare * prior.spin;
    MotionState state = initialState(key_frame.time, piece, prior, measurement);
    correct(state, measurement, kNoiseScale);
    objects_.push_back({std::move(tracker), prior, piece, state});
  }
}

std::vector<NamedMotion> LiveAnalyser::add(const Frame& frame) {
  if (!(frame.time > last_.time)) {
    throw std::invalid_argument("live analyser: frame at " + std::to_string(frame.time) +
                                " s is not later than the one before (" +
                                std::to_string(last_.time) + " s); give frames in order of time");
  }
  const bool cut = isCut(last_, frame, params_.cut_correlation);
  std::vector<NamedMotion> motions;
  for (Followed& object : objects_) motions.push_back(follow(frame, cut, object));
  last_ = frame;
  return motions;
}

NamedMotion LiveAnalyser::follow(const Frame& frame, bool cut, Followed& object) const {
  const Observation observation = object.tracker.track(frame, cut);
  const Eigen::Vector3d& centroid = object.tracker.centroid();
  const PoseMeasurement measurement = measurementsOf({observation}, centroid).front();
  MotionState next = predicted(object.state, frame.time, object.piece);
  if (measurement.valid) {
    if (cut || squaredSurprise(next, measurement, kNoiseScale) > kCollisionSurprise) {
      MotionPiece fresh = object.piece;
      fresh.cut = cut;
      const double between = 0.5 * (object.state.time + frame.time);
      next =
          predicted(enterPiece(predicted(object.state, between, object.piece), fresh, object.prior),
                    frame.time, object.piece);
    }
    correct(next, measurement, kNoiseScale);
  }
  object.state = next;
  return {object.tracker.model().name,
          motionFrom(next, centroid, clearlyMoves(next), observation.inliers())};
}

}  // namespace calipso::flow

#include <algorithm>
#include <utility>

#include "calipso_flow/object_motion.hpp"
#include "calipso_flow/object_tracker.hpp"
#include "view_change.hpp"

// Which frames an object is compared with, and what they say of its pose.
namespace calipso::flow {
namespace {

constexpr double kOtherView = 0.1;  // rad, or relative distance: looks from nearer show the same
// rad, or relative distance: seen from farther a look is drawn out
constexpr double kFarView = 0.5;

}  // namespace

ObjectTracker::Reference ObjectTracker::asReference(const Frame& frame,
                                                    const Observation& observation) const {
  return {
      ReferenceView(frame, model_, observation.world_from_object, cv::Mat(), params_.seed_count),
      observation.covariance, observation.covariance - observation.persistent};
}

ObjectTracker::Reference ObjectTracker::lastAsReference() const {
  return asReference(last_frame_, *last_);
}

// A reference passes its error on to all that is compared with it, other references among them: for
// its pose the outline may say what the pose of the one before errs by. In between, poses follow
// the points alone, which are smoother from frame to frame.
ObjectTracker::Reference ObjectTracker::newReference(const Frame& frame, const Reference& nearest,
                                                     const Observation& observation) {
  Observation anchored = observation;
  refineFinely(frame, nearest.view, drowned_ ? wide_ : params_, anchored, nearest.covariance);
  const bool surely = anchored.inliers() >= kLeastInlierShare * observation.inliers();
  return asReference(frame, surely ? anchored : observation);
}

// Looked at again with a reference whose errors are smaller, unless that shows too little of it.
Observation ObjectTracker::withReference(const Frame& frame, const Reference& reference,
                                         Observation found) {
  Observation again = refine(frame, reference, found.world_from_object, drowned_ ? wide_ : params_);
  return again.inliers() >= kLeastInlierShare * found.inliers() ? again : found;
}

void ObjectTracker::remember(const Frame& frame, const Observation& observation, bool cut) {
  before_last_ = cut ? std::nullopt : last_;
  last_ = observation;
  last_frame_ = frame;
  const double depth =
      (frame.camera.world_from_camera.inverse() * (observation.world_from_object * centroid_))
          .norm();
  fall_.take(measured(observation), priorFor(frame.camera, depth, params_.gravity));
  due_inliers_ = std::max(due_inliers_, observation.inliers());
  Reference& nearest = nearestReference(frame, observation.world_from_object);
  nearest.most_inliers = std::max(nearest.most_inliers, observation.inliers());
  // A reference that shows the object from the same side would have the same tracks, and this
  // pose's errors.
  const double change = viewChange(nearest.view, frame, observation.world_from_object, centroid_);
  if (change < kOtherView) return;
  const bool worn = observation.inliers() < params_.least_inliers * nearest.most_inliers;
  if (!worn && observation.coverage >= params_.least_coverage && change < kFarView) return;
  Reference taken = newReference(frame, nearest, observation);
  if (static_cast<int>(references_.size()) >= params_.max_references) {
    references_.erase(references_.begin() + 1);  // the key frame stays
  }
  references_.push_back(std::move(taken));
  due_inliers_ = static_cast<int>(references_.back().view.seeds().size());
  look_ = {};  // the references may have moved
}

}  // namespace calipso::flow

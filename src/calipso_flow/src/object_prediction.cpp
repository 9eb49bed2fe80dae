// Where an object is expected in the next frame; see object_tracker.hpp.
#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_flow/coarse_search.hpp"
#include "calipso_flow/object_motion.hpp"
#include "calipso_flow/object_tracker.hpp"
#include "calipso_flow/picture_change.hpp"
#include "calipso_flow/rotation.hpp"
#include "view_change.hpp"

namespace calipso::flow {
namespace {

constexpr double kFirstSearch = 0.2;  // of the picture's width, while no motion is known
constexpr double kStayedPx = 0.3;     // what may have shifted by less is matched from where it was

}  // namespace

Eigen::Isometry3d ObjectTracker::predict(double time, const Eigen::Vector3d& acceleration) const {
  if (!before_last_ || frames_lost_ >= kForgetAfter) return last_->world_from_object;
  const double share = (time - last_->time) / (last_->time - before_last_->time);
  const Eigen::Isometry3d& from = before_last_->world_from_object;
  const Eigen::Isometry3d& to = last_->world_from_object;
  Vector6d motion;
  motion << to * centroid_ - from * centroid_,
      vectorFromRotation(to.linear() * from.linear().transpose());
  motion *= share;
  // From the mean velocity between two frames to that between the next two.
  motion.head<3>() += 0.5 * (time - last_->time) * (time - before_last_->time) * acceleration;
  return movePose(to, centroid_, motion);
}

PoseMeasurement ObjectTracker::measured(const Observation& observation) const {
  return measurementsOf({observation}, centroid_).front();
}

// It goes on, or it falls: whichever looks more like the frame. What is lost in a fall falls on.
Eigen::Isometry3d ObjectTracker::likeliestPrediction(const Frame& frame) {
  const Eigen::Isometry3d on = predict(frame.time, Eigen::Vector3d::Zero());
  const Eigen::Isometry3d falling =
      fall_.holds(frame.time)
          ? motionFrom(fall_.at(frame.time), centroid_, true, 0).world_from_object
          : predict(frame.time, params_.gravity);
  if (imageMotion(frame.camera, on, falling, {centroid_}).largest < kNearPx) return on;
  if (fall_.holds(frame.time) && frames_lost_ > 0) return falling;
  const Reference& nearest = nearestReference(frame, on);
  const auto likeness = [&](const Eigen::Isometry3d& pose) {
    return correlationInPlace(lookAt(frame, nearest.view, pose, Care::kRough).warped, frame.gray);
  };
  return likeness(falling) > likeness(on) ? falling : on;
}

bool ObjectTracker::isOutOfPicture(const Frame& frame, const Eigen::Isometry3d& predicted) const {
  return fall_.holds(frame.time) &&
         seedsInPicture(references_.front().view, frame.camera, predicted) == 0;
}

// The object may have stopped, or turned round: look as far as twice back to where it was.
Eigen::AlignedBox2d ObjectTracker::reachFrom(const Frame& frame,
                                             const Eigen::Isometry3d& predicted) const {
  const Eigen::Vector2d home = frame.camera.projectWorld(predicted * centroid_);
  const Eigen::Vector2d before = frame.camera.projectWorld(last_->world_from_object * centroid_);
  // Without a motion to go by, it may be anywhere near.
  const bool falls = fall_.holds(frame.time) && frames_lost_ > 0;
  const bool known = falls || (before_last_ && frames_lost_ < kForgetAfter);
  const double search =
      known ? params_.search_px : std::max(params_.search_px, kFirstSearch * frame.camera.width);
  const Eigen::Vector2d margin(search, search);
  Eigen::AlignedBox2d reach(-margin, margin);
  if (falls) return reach;
  const Eigen::Vector2d back = 1.5 * (before - home);
  reach.extend(Eigen::AlignedBox2d(back - margin, back + margin));
  return reach;
}

// Whether the frame shows the object, with its outline, as the one did in which it was found last:
// few tracks are then no sign that it has gone. A camera that moves changes the picture.
bool ObjectTracker::hasStayed(const Frame& frame, const Reference& nearest) {
  if (!frame.camera.world_from_camera.isApprox(last_frame_.camera.world_from_camera, 0.0))
    return false;
  const ReferenceView::Warped& look =
      lookAt(frame, nearest.view, last_->world_from_object, Care::kRough).warped;
  if (look.coverage == 0.0) return false;
  cv::Mat with_outline;
  cv::dilate(look.covered, with_outline, cv::Mat());
  const cv::Point origin(look.gray.origin);
  return largestShift(last_frame_.gray, frame.gray, with_outline, origin) < kStayedPx;
}

// Where it was, with small patches or large ones.
Observation ObjectTracker::inPlace(const Frame& frame, const Reference& nearest) {
  const Eigen::Isometry3d place = last_->world_from_object;
  Observation best = refine(frame, nearest, place, drowned_ ? wide_ : params_);
  if (isClear(best)) return best;
  Observation other = refine(frame, nearest, place, drowned_ ? params_ : wide_);
  if (other.inliers() > best.inliers()) {
    best = std::move(other);
    drowned_ = !drowned_;
  }
  due_inliers_ = best.inliers();
  return best;
}

// The picture has not changed, though too few of its points say where the object is: its pose errs
// as before, and by what may have shifted besides. It is not remembered: frames to come are
// compared with the one in which the object was found, so that a creep adds up, and no motion is
// assumed in them.
Observation ObjectTracker::asBefore(const Frame& frame) {
  ++frames_lost_;
  const double depth =
      (frame.camera.world_from_camera.inverse() * (last_->world_from_object * centroid_)).z();
  const double shift = kStayedPx * depth / frame.camera.fx;
  const double turn = shift / (0.5 * boundingDiagonal(model_.mesh));
  Observation stayed = *last_;
  stayed.time = frame.time;
  stayed.drift = Matrix6d::Zero();
  stayed.covariance.diagonal().head<3>().array() += shift * shift;
  stayed.covariance.diagonal().tail<3>().array() += turn * turn;
  return stayed;
}

}  // namespace calipso::flow

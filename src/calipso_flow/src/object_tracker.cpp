#include "calipso_flow/object_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "calipso_flow/coarse_search.hpp"
#include "calipso_flow/look_match.hpp"
#include "calipso_flow/object_motion.hpp"
#include "calipso_flow/rotation.hpp"
#include "calipso_flow/turn_search.hpp"
#include "seed_tracks.hpp"
#include "view_change.hpp"

namespace calipso::flow {
namespace {

constexpr int kRefinements = 2;  // warp, match both ways, fit
// of a patch's radius: poses this close need no look of their own
constexpr double kSameLookShare = 0.025;
// of the frame before's tracks: with so many no search is needed
constexpr double kClearShare = 0.7;
// looks that differ by this, but for where they are, serve for one another
constexpr double kSameShapePx = 1.0;
constexpr double kLeastVisibleShare = 0.25;  // of the seeds inside the picture
constexpr int kWeakInliers = 12;             // fewer tracks than this are worth another attempt
constexpr double kStaysShare = 0.01;         // of the diagonal: what moves less has not moved
constexpr double kPatchShare = 1.0 / 160.0;  // of the picture's width: a patch's radius
constexpr int kLargestRadius = 9;            // px
constexpr double kSearchWidth = 640.0;       // px: wider pictures are searched as much farther
// of the seeds in the picture: with fewer tracks noise or blur drowns small patches
constexpr double kDrownedShare = 0.35;
constexpr double kTurnedShare = 0.35;  // of the tracks due: with fewer the object may have turned
constexpr size_t kTurnsTried = 12;
// of the object's extent, of its outline seen from another side
constexpr double kShapeError = 0.01;
constexpr double kIndependent = 1.5;  // errors along an outline: they are off nearly as one
// rad, or relative distance: what a wrong shape does to the pose is forgotten over such a change of
// view, as it is over as large a part of the picture (pose_fit.cpp)
constexpr double kViewLength = 0.4;
constexpr double kKeySigma = 1e-4;  // of the diagonal: the key pose is given, not measured

}  // namespace

int Observation::inliers() const {
  return static_cast<int>(
      std::count_if(tracks.begin(), tracks.end(), [](const Track& t) { return t.inlier; }));
}

ObjectTracker::ObjectTracker(const ObjectModel& model, const Frame& key_frame, const cv::Mat& mask,
                             const TrackerParams& params)
    : model_(model),
      edges_(edgesOf(model.mesh)),
      params_(params),
      centroid_(flow::centroid(model.mesh)) {
  // What a larger picture shows larger is not seen sharper by as much.
  const int scaled = static_cast<int>(std::lround(kPatchShare * key_frame.camera.width));
  params_.patch.radius_px = std::max(params_.patch.radius_px, std::min(scaled, kLargestRadius));
  params_.search_px *= std::max(1.0, key_frame.camera.width / kSearchWidth);
  wide_ = params_;
  wide_.patch.radius_px = std::max(params_.patch.radius_px, kLargestRadius);
  for (TrackerParams* of : {&params_, &wide_}) of->pose.patch_px = 2 * of->patch.radius_px + 1;
  references_.push_back(
      {ReferenceView(key_frame, model_, model.world_from_object, mask, params.seed_count),
       Matrix6d::Zero()});
  const double sigma = kKeySigma * boundingDiagonal(model.mesh);
  key_.time = key_frame.time;
  key_.found = true;
  key_.world_from_object = model.world_from_object;
  key_.covariance.diagonal() << Eigen::Vector3d::Constant(sigma * sigma),
      Eigen::Vector3d::Constant(kKeySigma * kKeySigma);
  for (const Eigen::Vector3d& seed : references_.front().view.seeds()) {
    key_.tracks.push_back(
        {seed, key_frame.camera.projectWorld(model.world_from_object * seed), 1.0, 0.0, true});
  }
  outline_bias_ = OutlineBias(
      findOutline(edges_, model.mesh, model.mesh.vertices,
                  references_.front().view.warp(key_frame.camera, model.world_from_object),
                  key_frame, model.world_from_object));
  last_ = key_;
  last_frame_ = key_frame;
  last_seen_time_ = key_.time;
  MotionPrior prior;
  prior.gravity = params_.gravity;
  fall_.take(measured(key_), prior);
  due_inliers_ = static_cast<int>(key_.tracks.size());
}

// The look of an object at rest serves for many frames; where it need not be exact, so does one
// that is shifted.
const ObjectTracker::Look& ObjectTracker::lookAt(const Frame& frame, const ReferenceView& reference,
                                                 const Eigen::Isometry3d& pose, Care care) {
  const bool shifted =
      care == Care::kForward && look_.reference == &reference &&
      imageMotion(frame.camera, look_.pose, pose, reference.seeds()).bend < kSameShapePx;
  if (!shifted && !isLookOf(frame, reference, pose)) {
    look_ = {&reference, frame.camera.world_from_camera, pose, reference.warp(frame.camera, pose)};
  }
  return look_;
}

bool ObjectTracker::isLookOf(const Frame& frame, const ReferenceView& reference,
                             const Eigen::Isometry3d& pose) const {
  return look_.reference == &reference &&
         look_.world_from_camera.isApprox(frame.camera.world_from_camera, 0.0) &&
         imageMotion(frame.camera, look_.pose, pose, reference.seeds()).largest <
             kSameLookShare * params_.patch.radius_px;
}

Eigen::Isometry3d ObjectTracker::searchCoarsely(const Frame& frame, const ReferenceView& reference,
                                                const Eigen::Isometry3d& predicted) {
  const ReferenceView::Warped& look = lookAt(frame, reference, predicted, Care::kRough).warped;
  if (look.coverage == 0.0) return predicted;
  return shiftInPicture(frame.camera, predicted, centroid_,
                        coarseDisplacement(look, frame.gray, reachFrom(frame, predicted)));
}

Observation ObjectTracker::refine(const Frame& frame, const Reference& reference,
                                  const Eigen::Isometry3d& start, const TrackerParams& params) {
  const bool near =
      imageMotion(frame.camera, last_->world_from_object, start, reference.view.seeds()).largest <
      kNearPx;
  Observation observation;
  observation.time = frame.time;
  observation.world_from_object = start;
  if (!near) {
    approach(frame, reference.view, params, observation);
  }
  refineFinely(frame, reference.view, params, observation);
  // The reference's own error is all of its frames': too far away there, the object is taken for
  // too far away here.
  observation.covariance += reference.covariance;
  observation.persistent += reference.covariance;
  observation.reference_time = reference.view.frame().time;
  observation.reference_error = reference.alone;
  return observation;
}

void ObjectTracker::refineFinely(const Frame& frame, const ReferenceView& reference,
                                 const TrackerParams& params, Observation& observation,
                                 const Matrix6d& reference_error) {
  for (int round = 0; round < kRefinements; ++round) {
    observation.world_from_object =
        refineOnce(frame, reference, Care::kChecked, params, observation, reference_error);
    // The same look again would give the same pose.
    if (!observation.found || isLookOf(frame, reference, observation.world_from_object)) break;
  }
}

// From a start that may be some pixels off. Large patches reach farther.
void ObjectTracker::approach(const Frame& frame, const ReferenceView& reference,
                             const TrackerParams& params, Observation& observation) {
  const Eigen::Isometry3d start = observation.world_from_object;
  observation.world_from_object = refineOnce(frame, reference, Care::kRough, params, observation);
  if (observation.inliers() < kClearShare * reference.seeds().size()) {
    Observation wide;
    wide.world_from_object = start;
    wide.world_from_object = refineOnce(frame, reference, Care::kRough, wide_, wide);
    if (wide.inliers() > observation.inliers())
      observation.world_from_object = wide.world_from_object;
  }
  observation.world_from_object = refineOnce(frame, reference, Care::kForward, params, observation);
}

Eigen::Isometry3d ObjectTracker::refineOnce(const Frame& frame, const ReferenceView& reference,
                                            Care care, const TrackerParams& params,
                                            Observation& observation,
                                            const Matrix6d& reference_error) {
  const Look& seen = lookAt(frame, reference, observation.world_from_object, care);
  // The same place, but for what is too little to be told, gives the same numbers.
  const Eigen::Isometry3d pose = care == Care::kForward ? observation.world_from_object : seen.pose;
  observation.found = false;
  observation.tracks.clear();
  observation.coverage = seen.warped.coverage;
  if (seen.warped.coverage == 0.0) return pose;
  std::vector<Correspondence> found;
  observation.tracks =
      followSeeds(LookMatch(seen.warped, frame.gray, care), reference, frame.camera, seen.pose,
                  pose, params, boundingDiagonal(model_.mesh), found);
  const size_t tracks = found.size();
  if (care != Care::kRough) addOutline(frame, seen, found);
  const PoseFit fit = fitPose(found, frame.camera, pose, centroid_, params.pose, reference_error);
  // Few agreeing matches where many are due are the background, not the object.
  const int due = seedsInPicture(reference, frame.camera, fit.world_from_object);
  observation.found = fit.converged && fit.inliers >= kLeastInlierShare * tracks &&
                      fit.inliers >= kLeastVisibleShare * due;
  if (!observation.found) return pose;
  for (size_t i = 0; i < tracks; ++i) observation.tracks[i].inlier = fit.inlier[i];
  observation.covariance = fit.covariance;
  observation.persistent = fit.persistent;
  observation.common = fit.common;
  observation.deviation = fit.deviation;
  return fit.world_from_object;
}

void ObjectTracker::addOutline(const Frame& frame, const Look& seen,
                               std::vector<Correspondence>& found) const {
  const Eigen::Isometry3d camera_from_object = frame.camera.world_from_camera.inverse() * seen.pose;
  const double extent_px =
      frame.camera.fx * boundingDiagonal(model_.mesh) / (camera_from_object * centroid_).z();
  // The shape was fitted to the key frame's outline; from other sides it is less certain.
  const double turned = viewChange(references_.front().view, frame, seen.pose, centroid_);
  const double shape_px = kShapeError * extent_px * std::min(1.0, turned);
  const std::vector<OutlineStep> steps =
      findOutline(edges_, model_.mesh, model_.mesh.vertices, seen.warped, frame, seen.pose);
  // Their errors are the shape's and its surroundings', which neighbours share.
  const double shared = std::max(1.0, steps.size() / kIndependent);
  for (const OutlineStep& step : steps) {
    const SurfaceMatch match = step.match(outline_bias_.towards(step.outward));
    const Eigen::Matrix2d shape = shape_px * shape_px * Eigen::Matrix2d::Identity();
    found.push_back({match.point, match.pixel, shared * (match.covariance + shape), true, shared});
  }
}

ObjectTracker::Reference& ObjectTracker::nearestReference(const Frame& frame,
                                                          const Eigen::Isometry3d& pose) {
  return *std::min_element(references_.begin(), references_.end(),
                           [&](const Reference& a, const Reference& b) {
                             return viewChange(a.view, frame, pose, centroid_) <
                                    viewChange(b.view, frame, pose, centroid_);
                           });
}

Observation ObjectTracker::track(const Frame& frame, bool cut) {
  if (!(frame.time > last_seen_time_)) {
    throw std::invalid_argument("object tracker: frame at " + std::to_string(frame.time) +
                                " s is not later than the one before (" +
                                std::to_string(last_seen_time_) +
                                " s); give frames in order of time");
  }
  last_seen_time_ = frame.time;
  if (cut) {
    frames_lost_ = kForgetAfter;
    fall_ = {};
  }
  const Eigen::Isometry3d predicted = likeliestPrediction(frame);
  if (isOutOfPicture(frame, predicted)) {
    ++frames_lost_;
    Observation lost;
    lost.time = frame.time;
    lost.world_from_object = predicted;
    return lost;
  }
  const Reference& nearest = nearestReference(frame, predicted);
  Observation best;
  if (frames_lost_ == 0 && before_last_)
    best = refine(frame, nearest, predicted, drowned_ ? wide_ : params_);
  if (!isClear(best)) {
    const bool stayed = !cut && hasStayed(frame, nearest);
    best = stayed ? inPlace(frame, nearest) : search(frame, nearest, predicted);
    if (stayed && !best.found) return asBefore(frame);
  }
  if (best.found && frames_lost_ > 0 && best.inliers() < kWeakInliers && fall_.holds(frame.time) &&
      !fall_.expects(measured(best)))
    best.found = false;  // few tracks that are not where it falls to are something else's
  frames_lost_ = best.found ? 0 : frames_lost_ + 1;
  if (best.found) {
    const double change =
        viewChange(last_frame_.camera.world_from_camera.inverse() * last_->world_from_object,
                   frame.camera.world_from_camera.inverse() * best.world_from_object, centroid_);
    best.drift = driftSinceLast(best, change);
    remember(frame, best, cut);
  }
  return best;
}

// The motion may have changed, the look, or the picture: tries every other way to recognise the
// object.
Observation ObjectTracker::search(const Frame& frame, const Reference& nearest,
                                  const Eigen::Isometry3d& predicted) {
  Observation best = refine(frame, nearest, searchCoarsely(frame, nearest.view, predicted),
                            drowned_ ? wide_ : params_);
  if (isClear(best)) return best;
  if (best.inliers() < kClearShare * due_inliers_ && frames_lost_ == 0) {
    auto other = fromFrameBefore(frame, nearest, predicted);
    if (other && other->inliers() > best.inliers()) best = std::move(*other);
  }
  if (best.inliers() < kWeakInliers) {
    for (const Reference& reference : references_) {
      Observation other =
          attempt(frame, reference, last_->world_from_object, drowned_ ? wide_ : params_);
      if (other.inliers() > best.inliers()) best = std::move(other);
    }
  }
  if (best.inliers() < kDrownedShare * seedsInPicture(nearest.view, frame.camera, predicted)) {
    Observation other = attempt(frame, nearest, predicted, drowned_ ? params_ : wide_);
    if (other.inliers() > best.inliers()) {
      best = std::move(other);
      drowned_ = !drowned_;
    }
  }
  if (best.inliers() < kTurnedShare * due_inliers_ && frames_lost_ < kForgetAfter && !stays(best)) {
    Observation other = findTurned(frame, predicted);
    if (other.inliers() > best.inliers()) best = std::move(other);
  }
  due_inliers_ = best.inliers();
  return best;
}

// What was struck turns otherwise than expected: any reference may show the side that is seen now,
// or the frame before.
Observation ObjectTracker::findTurned(const Frame& frame, const Eigen::Isometry3d& predicted) {
  const Reference before = lastAsReference();
  std::vector<const Reference*> references{&before};
  std::vector<const ReferenceView*> views{&before.view};
  for (const Reference& reference : references_) {
    references.push_back(&reference);
    views.push_back(&reference.view);
  }
  Observation best;
  best.time = frame.time;
  for (const TurnedPose& turned : searchTurned(
           views, frame, {predicted, centroid_, reachFrom(frame, predicted)}, kTurnsTried)) {
    Observation found =
        refine(frame, *references[turned.reference], turned.pose, drowned_ ? wide_ : params_);
    if (found.inliers() > best.inliers()) best = std::move(found);
  }
  if (best.found)
    best = withReference(frame, nearestReference(frame, best.world_from_object), std::move(best));
  look_ = {};  // `before` goes
  return best;
}

// What has turned since its reference still looks as it did a frame ago. Found so, it is looked at
// again with the reference, whose errors are smaller.
std::optional<Observation> ObjectTracker::fromFrameBefore(const Frame& frame,
                                                          const Reference& nearest,
                                                          const Eigen::Isometry3d& predicted) {
  if (nearest.view.frame().time == last_->time) return std::nullopt;
  const Reference before = lastAsReference();
  Observation found = attempt(frame, before, predicted, drowned_ ? wide_ : params_);
  if (!found.found) return std::nullopt;
  found = withReference(frame, nearest, std::move(found));
  look_ = {};  // `before` goes
  return found;
}

// What is found where it was expected needs no search.
Observation ObjectTracker::attempt(const Frame& frame, const Reference& reference,
                                   const Eigen::Isometry3d& predicted,
                                   const TrackerParams& params) {
  if (frames_lost_ == 0 && before_last_) {
    Observation expected = refine(frame, reference, predicted, params);
    if (isClear(expected)) return expected;
  }
  return refine(frame, reference, searchCoarsely(frame, reference.view, predicted), params);
}

// As many tracks as are due; few are enough for an object that has not moved.
bool ObjectTracker::isClear(const Observation& observation) const {
  if (!observation.found || observation.inliers() < kClearShare * due_inliers_) return false;
  return observation.inliers() >= kWeakInliers || stays(observation);
}

bool ObjectTracker::stays(const Observation& observation) const {
  return observation.found &&
         (observation.world_from_object * centroid_ - last_->world_from_object * centroid_).norm() <
             kStaysShare * boundingDiagonal(model_.mesh);
}

// Errors of covariance C that are correlated by q differ by 2 (1 - q) C.
// @param change  of the view since
Matrix6d ObjectTracker::driftSinceLast(const Observation& observation, double change) const {
  const Matrix6d forgotten =
      (1.0 - std::exp(-change / kViewLength)) * (last_->persistent + observation.persistent);
  if (observation.reference_time == last_->reference_time) return forgotten;
  return forgotten + last_->reference_error + observation.reference_error;
}

}  // namespace calipso::flow

#include "calipso_flow/deformable_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "calipso_flow/look_match.hpp"
#include "calipso_flow/outline_match.hpp"
#include "calipso_flow/surface_view.hpp"
#include "calipso_scene/median.hpp"

namespace calipso::flow {
namespace {

constexpr int kPoints = 150;          // surface points followed
constexpr double kRoughScale = 30.0;  // deviations; residuals of a rough match
constexpr double kFineScale = 40.0;
constexpr double kLeastInlierShare = 0.35;
// px: where the last frame was foreseen so well, this one is matched at once.
constexpr double kForeseenPx = 0.7;
constexpr int kRadius = 5;  // px, of a patch: a sheet is often plain
// px, of a square as large as the sheet is seen: from twice that on, a smaller picture does.
constexpr double kSheetSide = 140.0;

DeformationField::Points matrixOf(const std::vector<Eigen::Vector3d>& points) {
  DeformationField::Points matrix(points.size(), 3);
  for (size_t i = 0; i < points.size(); ++i) matrix.row(i) = points[i].transpose();
  return matrix;
}

// How many times smaller the frames are in which a sheet is followed: where it is seen larger, a
// patch has too little of a plain sheet's pattern. What bends little is measured as finely as it is
// seen.
int reductionFor(const DeformationField& field, const ObjectModel& model, const Camera& camera) {
  if (!field.sheetNormal()) return 1;
  const SurfaceView view =
      viewSurface(model.mesh, camera, camera.world_from_camera.inverse() * model.world_from_object);
  const double side = view.empty() ? 0.0 : std::sqrt(cv::countNonZero(view.depth > 0.0f));
  return std::max(1, static_cast<int>(side / kSheetSide));
}

cv::Mat reducedMask(const cv::Mat& mask, const Camera& camera, int factor) {
  if (mask.empty() || factor == 1) return mask;
  cv::Mat small;
  const cv::Rect whole(0, 0, camera.width * factor, camera.height * factor);
  cv::resize(mask(whole) != 0, small, {camera.width, camera.height}, 0, 0, cv::INTER_AREA);
  return small > 127;
}

}  // namespace

DeformableTracker::DeformableTracker(const ObjectModel& model, const Frame& key_frame,
                                     const cv::Mat& mask, const TrackerParams& params)
    : model_(model),
      params_(params),
      edges_(edgesOf(model.mesh)),
      fitter_(model, params.deformation),
      reduction_(reductionFor(fitter_.field(), model, key_frame.camera)),
      reference_(inReduced(key_frame, mask)),
      vertex_weights_(fitter_.field().weightsAt(model.mesh.vertices)),
      points_(matrixOf(reference_.gridPoints(kPoints))) {
  point_weights_ = fitter_.field().weightsAt(points_);
  params_.patch = stripePatches(params.patch);
  params_.patch.radius_px = std::max(params.patch.radius_px, kRadius);
  const Frame& key = reference_.frame();
  outline_bias_ = OutlineBias(findOutline(edges_, model.mesh, model.mesh.vertices,
                                          reference_.warp(key.camera, model.world_from_object), key,
                                          model.world_from_object));
  last_ = keyObservation();
  last_.time = key_frame.time;
}

ReferenceView DeformableTracker::inReduced(const Frame& key_frame, const cv::Mat& mask) const {
  const Frame small = reduced(key_frame, reduction_);
  return ReferenceView(small, model_, model_.world_from_object,
                       reducedMask(mask, small.camera, reduction_), params_.seed_count);
}

DeformationObservation DeformableTracker::keyObservation() const {
  DeformationObservation key;
  key.time = reference_.frame().time;
  key.found = true;
  key.controls = fitter_.zero();
  key.covariance = Eigen::MatrixXd::Zero(key.controls.size(), key.controls.size());
  return key;
}

decltype(TriangleMesh::vertices) DeformableTracker::surfaceAt(
    const Eigen::VectorXd& controls) const {
  return DeformationFitter::displaced(model_.mesh.vertices, vertex_weights_, controls);
}

Eigen::VectorXd DeformableTracker::predict(double time) const {
  if (!before_last_) return last_.controls;
  const double share = (time - last_.time) / (last_.time - before_last_->time);
  return last_.controls + share * (last_.controls - before_last_->controls);
}

std::vector<SurfaceMatch> DeformableTracker::match(const Frame& frame,
                                                   const Eigen::VectorXd& controls, Care care,
                                                   Eigen::VectorXd* brightness) const {
  std::vector<SurfaceMatch> matches;
  const auto surface = surfaceAt(controls);
  const auto look = reference_.warp(frame.camera, model_.world_from_object, surface);
  if (look.coverage == 0.0) return matches;
  const LookMatch pictures(look, frame.gray, care);
  const auto points = DeformationFitter::displaced(points_, point_weights_, controls);
  const Eigen::Isometry3d camera_from_object =
      frame.camera.world_from_camera.inverse() * model_.world_from_object;
  std::vector<int> visible;
  std::vector<LookMatch::Seed> pixels;
  for (int i = 0; i < points.rows(); ++i) {
    const Eigen::Vector3d p = camera_from_object * points.row(i).transpose();
    if (p.z() <= 0.0) continue;
    visible.push_back(i);
    const Eigen::Vector2d pixel = frame.camera.project(p);
    pixels.push_back({pixel, pixel});
  }
  const LookMatch::Matches found = LookMatch::forEach(pixels, [&](const LookMatch::Seed& seed) {
    return pictures.findSurely(seed, params_.patch, params_.trust);
  });
  for (size_t i = 0; i < visible.size(); ++i) {
    if (!found[i]) continue;
    matches.push_back(
        {points_.row(visible[i]).transpose(), found[i]->position, found[i]->covariance});
    if (!brightness) continue;
    const auto brighter = pictures.brightening(pixels[i], *found[i], params_.patch.radius_px);
    if (brighter) (*brightness)[visible[i]] = *brighter;
  }
  if (care == Care::kRough) return matches;
  for (const OutlineStep& step :
       findOutline(edges_, model_.mesh, surface, look, frame, model_.world_from_object)) {
    matches.push_back(step.match(outline_bias_.towards(step.outward)));
  }
  return matches;
}

bool DeformableTracker::isForeseen() const {
  return before_last_ && last_miss_px_ < kForeseenPx && fitter_.field().sheetNormal();
}

// Median way in the picture from where the tracks' points were predicted to where they are, px.
double DeformableTracker::missOf(const Eigen::VectorXd& predicted,
                                 const DeformationObservation& observation,
                                 const Frame& frame) const {
  std::vector<Eigen::Vector3d> rest;
  for (const Track& track : observation.tracks) rest.push_back(track.point);
  const DeformationField::Points points = matrixOf(rest);
  const auto weights = fitter_.field().weightsAt(points);
  const auto foreseen = DeformationFitter::displaced(points, weights, predicted);
  const auto found = DeformationFitter::displaced(points, weights, observation.controls);
  std::vector<double> misses;
  for (int i = 0; i < points.rows(); ++i) {
    const Eigen::Vector2d there =
        frame.camera.projectWorld(model_.world_from_object * found.row(i).transpose());
    const Eigen::Vector2d expected =
        frame.camera.projectWorld(model_.world_from_object * foreseen.row(i).transpose());
    misses.push_back((there - expected).norm());
  }
  return misses.empty() ? std::numeric_limits<double>::infinity() : median(std::move(misses));
}

Track DeformableTracker::trackOf(const SurfaceMatch& match, bool inlier) const {
  const Eigen::Vector2d half = Eigen::Vector2d::Constant(0.5);
  return {match.point, reduction_ * (match.pixel + half) - half, 1.0,
          reduction_ * std::sqrt(0.5 * match.covariance.trace()), inlier};
}

DeformationObservation DeformableTracker::track(const Frame& whole, bool cut) {
  if (cut) before_last_.reset();
  const Frame frame = reduced(whole, reduction_);
  const Eigen::VectorXd predicted = predict(frame.time);
  DeformationObservation observation;
  observation.time = frame.time;
  observation.controls = predicted;
  observation.brightness.setConstant(points_.rows(), std::numeric_limits<double>::quiet_NaN());
  // Without a motion to go by, the shape may be some pixels away.
  for (const Care care : {Care::kRough, Care::kForward, Care::kChecked}) {
    if (care == Care::kRough && before_last_) continue;
    if (care == Care::kForward && isForeseen()) continue;
    const auto matches = match(frame, observation.controls, care,
                               care == Care::kChecked ? &observation.brightness : nullptr);
    const DeformationFit fit = fitter_.fit(matches, frame.camera, observation.controls, predicted,
                                           care == Care::kRough ? kRoughScale : kFineScale);
    observation.found = fit.converged && fit.inliers >= kLeastInlierShare * matches.size();
    if (!observation.found) break;
    observation.controls = fit.controls;
    observation.covariance = fit.covariance;
    observation.assumed = fit.assumed;
    observation.deviation = fit.deviation;
    observation.tracks.clear();
    for (size_t i = 0; i < matches.size(); ++i)
      observation.tracks.push_back(trackOf(matches[i], fit.inlier[i]));
  }
  if (!observation.found) {
    before_last_.reset();
    return observation;
  }
  last_miss_px_ = missOf(predicted, observation, frame);
  if (!cut) before_last_ = last_;  // across a cut nothing moved on
  last_ = observation;
  return observation;
}

}  // namespace calipso::flow

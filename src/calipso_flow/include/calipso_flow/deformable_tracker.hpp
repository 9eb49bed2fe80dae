#pragma once

#include <optional>
#include <vector>

#include "calipso_flow/deformation_fit.hpp"
#include "calipso_flow/object_tracker.hpp"
#include "calipso_flow/outline_match.hpp"

namespace calipso::flow {

// How an object was found deformed in one frame.
struct DeformationObservation {
  double time = 0.0;  // s
  bool found = false;
  Eigen::VectorXd controls;    // of the field, from the shape in the key frame
  Eigen::MatrixXd covariance;  // of controls, m^2
  Eigen::MatrixXd assumed;     // see DeformationFit; empty in the key frame
  double deviation = 0.0;      // see DeformationFit
  std::vector<Track> tracks;
  // Logarithm of the brightness over that in the key frame at DeformableTracker::points; NaN where
  // a point is not found.
  Eigen::VectorXd brightness;
};

// Follows an object that deforms from its shape in the key frame: its look is warped along the
// deformed surface to the predicted shape, patches are matched from there to the frame, and a
// smooth deformation is fitted to them. The reference is always the key frame, so that errors do
// not add up. Not thread-safe; frames come in order of time.
class DeformableTracker {
 public:
  // @param mask  as ObjectTracker's
  DeformableTracker(const ObjectModel& model, const Frame& key_frame, const cv::Mat& mask,
                    const TrackerParams& params);

  DeformationObservation keyObservation() const;
  // @param cut  the picture does not continue the last one: no motion is assumed
  DeformationObservation track(const Frame& frame, bool cut);

  const ObjectModel& model() const { return model_; }
  const DeformationFitter& fitter() const { return fitter_; }
  const Eigen::Isometry3d& keyCamera() const { return reference_.frame().camera.world_from_camera; }
  // The deformed surface, object frame.
  decltype(TriangleMesh::vertices) surfaceAt(const Eigen::VectorXd& controls) const;
  const DeformationField::Points& points() const { return points_; }  // followed, object frame
  const DeformationField::Weights& vertexWeights() const { return vertex_weights_; }

 private:
  ReferenceView inReduced(const Frame& key_frame, const cv::Mat& mask) const;
  Track trackOf(const SurfaceMatch& match, bool inlier) const;
  Eigen::VectorXd predict(double time) const;
  // A sheet that was foreseen well is matched at once; a solid's vibration is too fine for that.
  bool isForeseen() const;
  double missOf(const Eigen::VectorXd& predicted, const DeformationObservation& observation,
                const Frame& frame) const;
  // @param brightness  null, or see DeformationObservation
  std::vector<SurfaceMatch> match(const Frame& frame, const Eigen::VectorXd& controls, Care care,
                                  Eigen::VectorXd* brightness) const;

  ObjectModel model_;
  TrackerParams params_;
  std::vector<SurfaceEdge> edges_;
  OutlineBias outline_bias_;  // of the key frame, where the shape is known
  DeformationFitter fitter_;
  int reduction_;  // frames are followed so many times smaller
  ReferenceView reference_;
  DeformationField::Weights vertex_weights_, point_weights_;
  DeformationField::Points points_;  // surface points followed, object frame
  DeformationObservation last_;
  std::optional<DeformationObservation> before_last_;
  double last_miss_px_ = 0.0;  // of the last prediction
};

}  // namespace calipso::flow

#pragma once

#include <optional>
#include <vector>

#include "calipso_flow/deformation_fit.hpp"
#include "calipso_flow/fall_filter.hpp"
#include "calipso_flow/look_match.hpp"
#include "calipso_flow/outline_match.hpp"
#include "calipso_flow/pose_fit.hpp"
#include "calipso_flow/reference_view.hpp"

namespace calipso::flow {

struct TrackerParams {
  int seed_count = 120;  // surface points followed at a time
  // below this share of the most tracks it had a reference is worn out
  double least_inliers = 0.65;
  double least_coverage = 0.55;  // below this share of known surface a new reference is taken
  int max_references = 12;
  double search_px = 24.0;  // the coarse search looks this far beyond the prediction
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  // m/s^2, world: what is let go falls
  PatchParams patch;
  MatchTrust trust;
  PoseFitParams pose;
  DeformationParams deformation;
};

// A surface point followed into one frame.
struct Track {
  Eigen::Vector3d point;  // object frame, m
  Eigen::Vector2d pixel;  // px
  double confidence;      // 0..1: correlation with the reference
  double deviation;       // px, of pixel, by the match's own account
  bool inlier;            // agrees with the rigid motion
};

// Where an object was found in one frame.
struct Observation {
  double time = 0.0;  // s
  bool found = false;
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();
  Matrix6d covariance = Matrix6d::Zero();  // (m of the centroid, rad), world axes
  Matrix6d persistent = Matrix6d::Zero();  // see PoseFit
  // By how much the persistent error may have changed since the object was found last.
  Matrix6d drift = Matrix6d::Zero();
  double reference_time = 0.0;  // s, of the frame that it was compared with
  // covariance of what that frame's pose errs by alone
  Matrix6d reference_error = Matrix6d::Zero();
  Matrix6d common = Matrix6d::Zero();  // see PoseFit
  double deviation = 0.0;              // see PoseFit
  double coverage = 0.0;               // see ReferenceView::Warped
  std::vector<Track> tracks;
  int inliers() const;
};

// Follows one rigid object from its pose in the key frame through the frames of a video (paper,
// section 7): the object's look is warped from a reference view to the predicted pose, surface
// points are matched from there to the frame by Lucas-Kanade, forward and back, and their positions
// give the pose. Not thread-safe; frames come in order of time.
class ObjectTracker {
 public:
  // @param mask  CV_8U of the picture's size: where the object is seen in the key frame; or empty
  ObjectTracker(const ObjectModel& model, const Frame& key_frame, const cv::Mat& mask,
                const TrackerParams& params = {});

  // The observation of the key frame itself: the aligned pose.
  const Observation& keyObservation() const { return key_; }

  // @param cut  the picture does not continue the last one: no motion is assumed
  Observation track(const Frame& frame, bool cut);

  const ObjectModel& model() const { return model_; }
  const Eigen::Vector3d& centroid() const { return centroid_; }  // object frame, m

 private:
  static constexpr double kLeastInlierShare = 0.35;  // of the matches

  static constexpr double kNearPx = 1.5;  // a prediction this close needs no half-size match
  static constexpr int kForgetAfter =
      3;  // frames without the object before its motion is forgotten

  // Where the object is at `time` if it goes on as it did, with an acceleration besides, m/s^2.
  Eigen::Isometry3d predict(double time, const Eigen::Vector3d& acceleration) const;
  PoseMeasurement measured(const Observation& observation) const;
  Eigen::Isometry3d likeliestPrediction(const Frame& frame);
  bool isOutOfPicture(const Frame& frame, const Eigen::Isometry3d& predicted) const;
  // A reference warped to a pose, as a camera sees it.
  struct Look {
    const ReferenceView* reference = nullptr;
    Eigen::Isometry3d world_from_camera, pose;
    ReferenceView::Warped warped;
  };
  // @param care  kForward: the look may be of another place
  const Look& lookAt(const Frame& frame, const ReferenceView& reference,
                     const Eigen::Isometry3d& pose, Care care);
  bool isLookOf(const Frame& frame, const ReferenceView& reference,
                const Eigen::Isometry3d& pose) const;
  Eigen::AlignedBox2d reachFrom(const Frame& frame, const Eigen::Isometry3d& predicted) const;
  Eigen::Isometry3d searchCoarsely(const Frame& frame, const ReferenceView& reference,
                                   const Eigen::Isometry3d& predicted);
  struct Reference {
    ReferenceView view;
    Matrix6d covariance = Matrix6d::Zero();  // of its pose, world axes; the key frame's is given
    Matrix6d alone = Matrix6d::Zero();       // the part of it that no other frame shares
    int most_inliers = 0;                    // that a frame had with it
  };
  Observation refine(const Frame& frame, const Reference& reference, const Eigen::Isometry3d& start,
                     const TrackerParams& params);
  void approach(const Frame& frame, const ReferenceView& reference, const TrackerParams& params,
                Observation& observation);
  Eigen::Isometry3d refineOnce(const Frame& frame, const ReferenceView& reference, Care care,
                               const TrackerParams& params, Observation& observation,
                               const Matrix6d& reference_error = Matrix6d::Zero());
  // @param reference_error  covariance of what the outline may say of the reference's own pose
  void refineFinely(const Frame& frame, const ReferenceView& reference, const TrackerParams& params,
                    Observation& observation, const Matrix6d& reference_error = Matrix6d::Zero());
  Reference& nearestReference(const Frame& frame, const Eigen::Isometry3d& pose);
  bool hasStayed(const Frame& frame, const Reference& nearest);
  Observation inPlace(const Frame& frame, const Reference& nearest);
  Observation asBefore(const Frame& frame);
  Observation attempt(const Frame& frame, const Reference& reference,
                      const Eigen::Isometry3d& predicted, const TrackerParams& params);
  std::optional<Observation> fromFrameBefore(const Frame& frame, const Reference& nearest,
                                             const Eigen::Isometry3d& predicted);
  Observation findTurned(const Frame& frame, const Eigen::Isometry3d& predicted);
  Reference asReference(const Frame& frame, const Observation& observation) const;
  Reference lastAsReference() const;
  Reference newReference(const Frame& frame, const Reference& nearest,
                         const Observation& observation);
  Observation withReference(const Frame& frame, const Reference& reference, Observation found);
  Observation search(const Frame& frame, const Reference& nearest,
                     const Eigen::Isometry3d& predicted);
  bool isClear(const Observation& observation) const;
  bool stays(const Observation& observation) const;  // found where it was
  Matrix6d driftSinceLast(const Observation& observation, double change) const;
  void remember(const Frame& frame, const Observation& observation, bool cut);

  // Where the object's outline is found in the frame, as far as the model is known from this side.
  void addOutline(const Frame& frame, const Look& seen, std::vector<Correspondence>& found) const;

  ObjectModel model_;
  std::vector<SurfaceEdge> edges_;
  OutlineBias outline_bias_;  // of the key frame, where the pose is known
  TrackerParams params_;
  // the same with large patches, for frames whose noise or blur drowns small ones
  TrackerParams wide_;
  Eigen::Vector3d centroid_;
  bool drowned_ = false;  // `wide_` found more of late
  std::vector<Reference> references_;
  Look look_;  // the last one, which often serves again
  Observation key_;
  std::optional<Observation> last_, before_last_;  // found, most recent first
  FallFilter fall_;
  Frame last_frame_;             // of `last_`
  double last_seen_time_ = 0.0;  // s; of the last frame, found in or not
  int frames_lost_ = 0;
  int due_inliers_ = 0;  // tracks that a clear observation has
};

}  // namespace calipso::flow

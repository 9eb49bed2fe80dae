#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "calipso_flow/clip_dynamics.hpp"
#include "calipso_flow/followed_object.hpp"
#include "calipso_flow/live_deformation.hpp"

namespace calipso::flow {

struct NamedMotion {
  std::string object;
  ObjectMotion motion;
  // Of a deforming object, in its CoarseModes: m, m/s. Empty for one that moves as a rigid body.
  Eigen::VectorXd mode_amplitudes = {}, mode_velocities = {};
};

// How an object has deformed of late: what describeDeformation takes.
struct DeformationWindow {
  std::string object;
  const DeformableTracker* tracker = nullptr;
  std::vector<DeformationObservation> observations;  // the first one found
};

// What the windows tell; of those too short nothing.
std::vector<ObjectDynamics> describe(const std::vector<DeformationWindow>& windows,
                                     const Eigen::Vector3d& gravity, bool with_wind);

// The motion of every object as the frames come: the tracker of ClipAnalyser with a filter that
// only looks back. A pose that the filter finds too surprising is taken for a collision between the
// last frame and this one. Not thread-safe.
class LiveAnalyser {
 public:
  // As ClipAnalyser's. @throw std::invalid_argument
  LiveAnalyser(const Frame& key_frame, const std::vector<ObjectModel>& models,
               const std::vector<cv::Mat>& masks, const Eigen::Vector3d& gravity,
               const DynamicsParams& params = {});

  // Takes the next frame in. @throw std::invalid_argument when it is not later than the last
  std::vector<NamedMotion> add(const Frame& frame);

  std::vector<std::string> deforming() const;  // names
  // The modes of a deforming object, which stay the same; nothing while it is rigid or unknown.
  const CoarseModes* modesOf(const std::string& object) const;
  // Of the deforming objects, over the last DynamicsParams::live_window. Their trackers live as
  // long as the analyser, and describeDeformation may read them while it takes in further frames.
  std::vector<DeformationWindow> windows() const;

 private:
  struct Deforming {
    CoarseModes modes;
    ModeFilter filter;
  };
  struct Live {
    FollowedObject followed;
    MotionPrior prior;
    MotionPiece piece;
    MotionState state;
    std::optional<Deforming> deforming;
  };
  NamedMotion follow(bool cut, Live& object) const;
  void filterPose(const Observation& observation, bool cut, Live& object) const;
  static void filterModes(bool cut, Live& object);

  DynamicsParams params_;
  Frame last_;
  std::deque<Frame> recent_;  // the frames just seen, oldest first
  std::vector<double> cut_times_;
  std::vector<Live> objects_;
};

}  // namespace calipso::flow

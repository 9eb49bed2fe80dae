#pragma once

#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calipso_flow/deformation_motion.hpp"
#include "calipso_flow/followed_object.hpp"
#include "calipso_flow/object_motion.hpp"
#include "calipso_flow/trajectory.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::flow {

struct DynamicsParams {
  TrackerParams tracker;
  TrajectoryParams trajectory;
  std::vector<SupportPlane> supports;  // all that holds things up; may be empty
  double rest_px = 0.3;                // image motion over a piece that tracking errors may explain
  double live_window = 3.0;      // s, looked back over live, for what needs more than one frame
  double cut_correlation = 0.5;  // successive pictures that agree less than this are cut apart
};

// One object over the clip.
struct ObjectDynamics {
  std::string name;
  double diagonal = 0.0;                  // m, of the model
  std::vector<ObjectMotion> motions;      // one per frame
  std::vector<Observation> observations;  // one per frame
  Trajectory trajectory;                  // of a deforming object: of its closest rigid motion
  std::optional<DeformationMotion> deformation;  // nothing: the object moves as a rigid body
};

// One line about what was found, for the user.
std::string summary(const std::vector<ObjectDynamics>& objects);

// Analyses a clip: follows every object through the frames as they come, then fits one trajectory
// per object over all of them. An object is rigid until it is held somewhere and is seen to move:
// from then on its deformation is followed. Not thread-safe.
class ClipAnalyser {
 public:
  // @param masks  per object in `models`: CV_8U where it is seen in the key frame; or empty
  // @throw std::invalid_argument when the numbers differ or a model is unusable
  ClipAnalyser(const Frame& key_frame, const std::vector<ObjectModel>& models,
               const std::vector<cv::Mat>& masks, const Eigen::Vector3d& gravity,
               const DynamicsParams& params = {});

  // @throw std::invalid_argument when the frame is not later than the one before it
  void add(const Frame& frame);

  int frameCount() const { return static_cast<int>(times_.size()); }
  const std::vector<double>& cutTimes() const { return cut_times_; }  // s, between two frames
  // @param with_wind  also estimate the wind that moves cloth
  std::vector<ObjectDynamics> finish(bool with_wind = true) const;

 private:
  void forEachObject(const std::function<void(size_t)>& work) const;
  ObjectDynamics finishObject(const FollowedObject& object, bool with_wind) const;

  DynamicsParams params_;
  Eigen::Vector3d gravity_;  // m/s^2, world
  Frame last_;
  std::deque<Frame> recent_;  // the frames just seen, oldest first
  std::vector<double> times_;
  std::vector<Camera> cameras_;  // per frame
  std::vector<double> cut_times_;
  std::vector<FollowedObject> objects_;
};

}  // namespace calipso::flow

#pragma once

#include <string>
#include <vector>

#include "calipso_flow/object_motion.hpp"
#include "calipso_flow/trajectory.hpp"

namespace calipso::flow {

struct DynamicsParams {
  TrackerParams tracker;
  TrajectoryParams trajectory;
  double rest_px = 0.3;          // image motion over a piece that tracking errors may explain
  double cut_correlation = 0.5;  // successive pictures that agree less than this are cut apart
};

// One object over the clip.
struct ObjectDynamics {
  std::string name;
  double diagonal = 0.0;                  // m, of the model
  std::vector<ObjectMotion> motions;     // one per frame
  std::vector<Observation> observations;  // one per frame
  Trajectory trajectory;
};

// One line about what was found, for the user.
std::string summary(const std::vector<ObjectDynamics>& objects);

// Analyses a clip: follows every object through the frames as they come, then fits one trajectory
// per object over all of them. Not thread-safe.
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
  std::vector<ObjectDynamics> finish() const;

 private:
  ObjectDynamics finishObject(size_t index) const;

  DynamicsParams params_;
  Eigen::Vector3d gravity_;  // m/s^2, world
  Frame last_;
  std::vector<double> times_;
  std::vector<double> cut_times_;
  std::vector<ObjectTracker> trackers_;
  std::vector<std::vector<Observation>> observations_;  // per object, per frame
};

}  // namespace calipso::flow

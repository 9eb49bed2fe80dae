#pragma once

#include <string>
#include <vector>

#include "calipso_flow/clip_dynamics.hpp"

namespace calipso::flow {

struct NamedMotion {
  std::string object;
  ObjectMotion motion;
};

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

 private:
  struct Followed {
    ObjectTracker tracker;
    MotionPrior prior;
    MotionPiece piece;
    MotionState state;
  };
  NamedMotion follow(const Frame& frame, bool cut, Followed& object) const;

  DynamicsParams params_;
  Frame last_;
  std::vector<Followed> objects_;
};

}  // namespace calipso::flow

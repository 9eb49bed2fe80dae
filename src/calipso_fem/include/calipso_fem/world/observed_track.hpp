#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "calipso_fem/world/world_types.hpp"

namespace calipso::fem {

// The motion of one object as the video shows it, a sample per frame. Between samples positions and
// velocities are interpolated, rotations along the shortest arc; outside the first and last hold.
class ObservedTrack {
 public:
  explicit ObservedTrack(const Eigen::Isometry3d& world_from_object_at_key_frame);

  // Keeps samples sorted by time; one of the same time is replaced.
  void add(const ObservedMotion& sample);
  bool empty() const { return samples_.empty(); }
  double begin() const { return samples_.front().time; }  // s. @pre not empty
  bool reaches(double time) const {
    return !samples_.empty() && samples_.back().time >= time - 1e-9;
  }  // s

  // At rest in the key-frame pose where nothing better is known.
  ObservedMotion at(double time) const;

 private:
  Eigen::Isometry3d key_pose_;
  std::vector<ObservedMotion> samples_;
  bool moves_ = false;  // any of them tells a motion
};

}  // namespace calipso::fem

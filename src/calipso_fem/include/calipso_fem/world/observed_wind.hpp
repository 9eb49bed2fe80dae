#pragma once

#include <Eigen/Core>
#include <vector>

namespace calipso::fem {

// Velocity of the air at one instant (calipso_msgs/Wind).
struct ObservedWind {
  double time = 0.0;                                     // s since the clip's first frame
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();    // m/s
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // m^2/s^2
};

// A wind that changes slowly: linear between its samples, outside of them as in the nearest one.
class WindTrack {
 public:
  // Keeps samples sorted by time; one of the same time is replaced.
  void add(const ObservedWind& sample);
  bool empty() const { return samples_.empty(); }

  // @pre not empty
  Eigen::Vector3d at(double time) const;
  double variance() const;  // m^2/s^2, mean over samples and axes
  WindTrack times(double factor) const;

 private:
  std::vector<ObservedWind> samples_;
};

}  // namespace calipso::fem

#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "calipso_flow/deformable_tracker.hpp"

namespace calipso::flow {

// A few coarse shapes that are known before anything has moved: those that what is assumed about
// the body holds back least,
//   H phi = (1 / s^2) G phi,  largest deviations s first,
// with the information H of the fitter's priors and the mean square G over the vertices.
struct CoarseModes {
  Eigen::MatrixXd shapes;  // phi, 3 #V x K, object frame; root mean square over the vertices: 1
  Eigen::MatrixXd dual;    // amplitudes = dual^T controls
};

CoarseModes coarseModesOf(const DeformableTracker& tracker, int count);

// Amplitudes and velocities of modes, looking back only: a Kalman filter per mode over amplitude,
// velocity and acceleration. How fast accelerations change is not known beforehand: filters with
// several jerks run side by side, and the one that has foreseen the last second best is heard.
class ModeFilter {
 public:
  // @param length  m, of the object: what its modes may do
  ModeFilter(int modes, double length);

  // @param cut  nothing is known any more about velocities
  void add(double time, const Eigen::VectorXd& amplitudes, const Eigen::VectorXd& deviations,
           bool cut);
  void skip(double time);  // a frame in which the object was not found

  Eigen::VectorXd amplitudes() const;  // m
  Eigen::VectorXd velocities() const;  // m/s
  Eigen::VectorXd velocityDeviations() const;

 private:
  struct ModeState {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  };
  struct Filter {
    double jerk = 0.0;      // m/s^3 per square root of Hz
    double surprise = 0.0;  // minus twice the log likelihood of late
    std::vector<ModeState> modes;
  };
  void predict(double time);
  const Filter& best() const;

  double length_;
  double time_ = 0.0;
  bool started_ = false;
  std::vector<Filter> filters_;
};

}  // namespace calipso::flow

#pragma once

// Noisy poses of known motions.

#include <random>
#include <vector>

#include "calipso_flow/motion_filter.hpp"
#include "calipso_flow/rotation.hpp"

namespace calipso::flow::test {

inline constexpr double kFps = 30.0;

inline MotionPrior testPrior() {
  MotionPrior prior;
  prior.position = 10.0;
  prior.velocity = 9.0;
  prior.acceleration = 90.0;
  return prior;
}

// Noisy poses of a motion given by position and rotation vector over time.
template <class Position, class Rotation>
std::vector<PoseMeasurement> measure(int frames, double sigma_m, double sigma_rad, int seed,
                                     Position position, Rotation rotation) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) {
    const double x = normal(random), y = normal(random), z = normal(random);
    return Eigen::Vector3d(sigma * Eigen::Vector3d(x, y, z));
  };
  std::vector<PoseMeasurement> result;
  for (int k = 0; k < frames; ++k) {
    PoseMeasurement m;
    m.time = k / kFps;
    m.position = position(m.time) + noise(sigma_m);
    m.rotation = rotationFromVector(noise(sigma_rad)) * rotationFromVector(rotation(m.time));
    m.covariance.setZero();
    m.covariance.diagonal() << Eigen::Vector3d::Constant(sigma_m * sigma_m),
        Eigen::Vector3d::Constant(sigma_rad * sigma_rad);
    m.valid = true;
    result.push_back(m);
  }
  return result;
}

inline Eigen::Vector3d still(double) { return Eigen::Vector3d::Zero(); }

// Falls from rest, and bounces back with `restitution` at `tc`.
inline Eigen::Vector3d bouncing(double t, double tc, double restitution) {
  const Eigen::Vector3d g(0.0, 0.0, -9.81);
  if (t < tc) return 0.5 * g * t * t;
  const Eigen::Vector3d after = -restitution * g * tc;
  return 0.5 * g * tc * tc + after * (t - tc) + 0.5 * g * (t - tc) * (t - tc);
}

}  // namespace calipso::flow::test

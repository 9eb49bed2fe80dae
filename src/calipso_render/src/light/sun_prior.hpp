#pragma once

#include <ceres/sized_cost_function.h>

#include <Eigen/Core>
#include <cmath>
#include <utility>

namespace calipso::render {

// What is known of a sun before anything is seen of it, mean and deviation: by daylight as by lamps
// it is some three times as strong, on what faces it, as the ambient light is on the mean of all
// sides, and stands neither at the horizon nor overhead.
inline const double kUsualStrength = std::log(3.0);  // of log L / A
inline constexpr double kStrengthVaries = 0.7;
inline constexpr double kUsualHeight = 0.7;  // of the sine of its elevation
inline constexpr double kHeightVaries = 0.25;

// Minus the log-likelihood of one channel's strength, of three that err together.
inline double unusualStrength(double log_ratio) {
  const double off = (log_ratio - kUsualStrength) / kStrengthVaries;
  return off * off / 6.0;
}

inline double unusualHeight(double sine) {
  const double off = (sine - kUsualHeight) / kHeightVaries;
  return 0.5 * off * off;
}

// The same as residuals: three of the channels, one of the height, times a weight.
// Parameter blocks as in ReflectanceCost: l, and A and L as logarithms.
class SunPriorCost : public ceres::SizedCostFunction<4, 3, 3, 3> {
 public:
  SunPriorCost(const Eigen::Vector3d& up, double weight)
      : up_(up),
        per_strength_(weight / (std::sqrt(3.0) * kStrengthVaries)),
        per_height_(weight / kHeightVaries) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    using Map = Eigen::Map<const Eigen::Vector3d>;
    using Matrix = Eigen::Map<Eigen::Matrix<double, 4, 3, Eigen::RowMajor>>;
    const Map l(parameters[0]), A(parameters[1]), L(parameters[2]);
    Eigen::Map<Eigen::Vector4d> r(residuals);
    r << per_strength_ * ((L - A).array() - kUsualStrength).matrix(),
        per_height_ * (l.dot(up_) - kUsualHeight);
    if (jacobians == nullptr) return true;

    if (jacobians[0] != nullptr) {
      Matrix J(jacobians[0]);
      J.topRows<3>().setZero();
      J.row(3) = per_height_ * up_.transpose();
    }
    for (const auto& [block, sign] : {std::pair{1, -1.0}, std::pair{2, 1.0}}) {
      if (jacobians[block] == nullptr) continue;
      Matrix J(jacobians[block]);
      J.setZero();
      J.topRows<3>().diagonal().setConstant(sign * per_strength_);
    }
    return true;
  }

 private:
  Eigen::Vector3d up_;
  double per_strength_, per_height_;
};

}  // namespace calipso::render

#pragma once

#include <optional>
#include <vector>

#include "calipso_flow/wind_estimate.hpp"
#include "sheet_family.hpp"

namespace calipso::flow {

constexpr double kWellShown = 0.95;  // of the motion's square: no other valley is looked for

// The least-squares problem of WindEstimate: residuals of the simulated against the observed
// amplitudes. Unknown are the wind at the knots, one after the other, and log s: together w.
class WindFit {
 public:
  WindFit(SheetFamily& sheets, const ObjectModel& model, const std::vector<double>& times,
          const DeformationModes& modes, const Eigen::Vector3d& gravity, const WindParams& params);

  struct Fitted {
    Eigen::VectorXd w;
    Eigen::MatrixXd amplitudes;  // T x K, with the w that the steps ended at
    bool all_seen = false;       // that is w
    Eigen::MatrixXd information;
    double cost = 0.0, left = 0.0;  // left: the residuals' part
  };
  // Gauss-Newton from `w`. Nothing where the sheet does not hang in its shape there.
  std::optional<Fitted> solve(const std::vector<double>& knots, Eigen::VectorXd w) const;
  // A steady wind and log s. A stiff sheet in much wind and a soft one in little are two valleys:
  // the better of both ends. Where neither shows the motion, it is for a changing wind to do, on
  // the stiff one, which answers it more evenly. Of a sheet whose stiffness is given, and which may
  // not move as a hanging sheet does at all, the first guess: more would follow its errors.
  // @param direction  unit vector, of the wind that is tried first
  std::optional<Fitted> steady(const Eigen::Vector3d& direction) const;
  // Amplitudes of the modes and, if asked for, how they depend on w. Nothing where the sheet is too
  // soft to hang in its shape.
  std::optional<SheetMotion> simulated(const std::vector<double>& knots, const Eigen::VectorXd& w,
                                       bool slopes) const;
  // What the simulation cannot show persists from frame to frame, and would otherwise outvote what
  // is known beforehand: from here on residuals count as the fewer independent ones that they are.
  void allowForPersistence(const Eigen::MatrixXd& amplitudes);

 private:
  struct Linearised {
    Eigen::VectorXd r;  // differences over their deviations, T x K flattened
    Eigen::MatrixXd J;
  };
  Linearised linearise(const SheetMotion& motion) const;
  // Information of what is known beforehand: wind is not endless, and changes slowly.
  Eigen::MatrixXd prior(const std::vector<double>& knots) const;
  // Gauss-Newton's step. Where the picture says little more than what was known beforehand, as of
  // wind along the sheet, it would follow the errors of the simulation: there w goes to what was
  // known beforehand.
  Eigen::VectorXd stepFrom(const Linearised& at, const Eigen::MatrixXd& P, const Eigen::VectorXd& w,
                           double damping) const;
  // The strength in `direction` that shows most; w and amplitudes alone.
  std::optional<Fitted> firstGuess(const Eigen::Vector3d& direction, double log_stiffness) const;
  // w, as it was known beforehand where the pictures say no more.
  Eigen::VectorXd seenPart(const Eigen::MatrixXd& J, const Eigen::MatrixXd& P,
                           const Eigen::VectorXd& w) const;
  Eigen::VectorXd flat(const Eigen::MatrixXd& amplitudes) const;  // over the deviations
  double leastInformation(const Eigen::VectorXd& information) const;

  SheetFamily& sheets_;
  const std::vector<double>& times_;
  const DeformationModes& modes_;
  const WindParams& params_;
  Eigen::Vector3d down_;                        // unit; zero without gravity
  Eigen::MatrixXd measured_;                    // Phi^+, K x 3 #V, world axes
  Eigen::VectorXd displacements_, velocities_;  // of the surface at the first time
  Eigen::MatrixXd deviations_;                  // T x K
  double spread_ = 1.0;                         // factor on them
};

}  // namespace calipso::flow

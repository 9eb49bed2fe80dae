#include "observed_drive.hpp"

#include <cmath>

namespace calipso::fem {
namespace {

// 1/s, omega^2 h + 2 omega: at 60 steps a second omega is 2 pi 8 Hz. What is slower is followed;
// what wavers faster, as the tracking does, is hardly.
constexpr double kLead = 143.0;
// Residual over loads and inner forces: the next step makes up for it.
constexpr double kTolerance = 3e-3;
constexpr double kLost = 0.5;  // ... beyond that the step has found no balance at all

}  // namespace

ObservedDrive::ObservedDrive(std::unique_ptr<SoftObject> twin) : twin_(std::move(twin)) {}

FemOptions ObservedDrive::twinOptions(FemOptions options) {
  options.mass_damping = kLead;
  options.newton_tolerance = kTolerance;
  return options;
}

Vec ObservedDrive::advance(const Vec& positions, const Vec& velocities, double h) {
  DeformableBody& body = twin_->body();
  const Vec from = body.positions();
  const double omega = (std::sqrt(1.0 + kLead * h) - 1.0) / h;
  Vec F = omega * omega * (positions - from) + 2.0 * omega * velocities;
  const Eigen::VectorXd& mass = body.model().lumpedMass();
  for (Eigen::Index d = 0; d < F.size(); ++d) F[d] *= mass[d / 3];
  twin_->setDrive(F);
  const StepReport report = twin_->step(h);
  holds_ = holds_ && (report.converged || report.residual < kLost);
  for (Eigen::Index d = 0; d < F.size(); ++d)
    F[d] -= mass[d / 3] * kLead / h * (body.positions()[d] - from[d]);
  return F;
}

}  // namespace calipso::fem

#include "calipso_fem/world/contact_solver.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

#include "anderson.hpp"
#include "dense_kernels.hpp"

namespace calipso::fem {
namespace {

double frictionLimit(const ContactRow& row, double normal) {
  return row.friction * (normal + row.held_normal) + row.held_tangential;
}

// One block: the normal part is solved exactly, then the tangential one inside its disk.
Eigen::Vector3d solveBlock(const Eigen::Matrix3d& W, const Eigen::Vector3d& velocity,
                           const ContactRow& row) {
  Eigen::Vector3d p = row.impulse;
  if (!(W(0, 0) > 0.0)) return p;  // both surfaces are held: no impulse can move them
  p[0] = std::max(-row.held_normal, p[0] - velocity[0] / W(0, 0));
  const Eigen::Vector2d u_t = velocity.tail<2>() + W.block<2, 1>(1, 0) * (p[0] - row.impulse[0]);
  // The larger eigenvalue of the tangential block makes the step a contraction.
  const double a = W(1, 1), b = W(1, 2), d = W(2, 2);
  const double stiffest = 0.5 * (a + d) + std::sqrt(0.25 * (a - d) * (a - d) + b * b);
  if (stiffest > 0.0) p.tail<2>() -= u_t / stiffest;
  const double limit = frictionLimit(row, p[0]), length = p.tail<2>().norm();
  if (length > limit) p.tail<2>() *= limit / length;
  return p;
}

// Pushes and sticks: the velocity that is left is what the last step was.
bool isInsideCone(const ContactRow& row, const Eigen::Vector3d& p) {
  constexpr double kInside = 1.0 - 1e-6;
  return p[0] > -row.held_normal && p.tail<2>().norm() < kInside * frictionLimit(row, p[0]);
}

// Where the sweeps so far together point to (Anderson): a heavy body's weight goes through a light
// one only little by little. A sweep that changes more than the one before makes a new start.
class Extrapolation {
 public:
  // @param before, rows, velocity  before the last sweep, and after it
  void apply(const Eigen::VectorXd& before, std::vector<ContactRow>& rows,
             Eigen::VectorXd& velocity) {
    const Eigen::VectorXd after = impulsesOf(rows);
    const double change = (after - before).norm();
    if (change > last_change_) anderson_.reset();
    last_change_ = change;
    const auto next = anderson_.next(before, after, velocity);
    if (!next) return;
    for (size_t i = 0; i < rows.size(); ++i) rows[i].impulse = next->first.segment<3>(3 * i);
    velocity = next->second;
  }
  static Eigen::VectorXd impulsesOf(const std::vector<ContactRow>& rows) {
    Eigen::VectorXd p(3 * rows.size());
    for (size_t i = 0; i < rows.size(); ++i) p.segment<3>(3 * i) = rows[i].impulse;
    return p;
  }

 private:
  Anderson anderson_;
  double last_change_ = std::numeric_limits<double>::infinity();
};

}  // namespace

ContactSolveReport solveContacts(const Eigen::MatrixXd& W, std::vector<ContactRow>& rows,
                                 int max_iterations, double tolerance, double velocity_tolerance) {
  const int n = static_cast<int>(rows.size());
  Eigen::VectorXd velocity(3 * n), change(3 * n);
  for (int i = 0; i < n; ++i) {
    velocity.segment<3>(3 * i) = rows[i].free_velocity;
    change.segment<3>(3 * i) = rows[i].impulse - rows[i].start_impulse;
  }
  velocity.noalias() += W * change;
  // While the first sweep changes a lot, the bodies are far from their end, and so is the problem.
  constexpr double kReduction = 0.02;
  // of the change that ends the sweeps: not worth telling the others
  constexpr double kNegligible = 0.1;
  double first = 0.0;
  ContactSolveReport report;
  report.converged = n == 0;
  Extrapolation extrapolation;
  while (!report.converged && report.iterations < max_iterations) {
    const Eigen::VectorXd before = Extrapolation::impulsesOf(rows);
    double largest_change = 0.0, largest = 0.0, fastest = 0.0;
    for (int i = 0; i < n; ++i) {
      const Eigen::Matrix3d own = W.block<3, 3>(3 * i, 3 * i);
      const Eigen::Vector3d p = solveBlock(own, velocity.segment<3>(3 * i), rows[i]);
      const Eigen::Vector3d step = p - rows[i].impulse;
      const double speed = (own * step).norm();
      largest_change = std::max(largest_change, step.norm());
      largest = std::max(largest, p.norm());
      fastest = std::max(fastest, speed);
      if (step.isZero(0.0)) continue;
      const bool negligible =
          speed < kNegligible * std::max(velocity_tolerance, kReduction * first);
      if (negligible && isInsideCone(rows[i], p)) continue;
      rows[i].impulse = p;
      addThree(W.col(3 * i).data(), 3 * n, step.data(), 3 * n, velocity.data());
    }
    ++report.iterations;
    report.residual = largest > 0.0 ? largest_change / largest : 0.0;
    if (report.iterations == 1 && velocity_tolerance > 0.0) first = fastest;
    // Where a heavy body rests on a light one, impulses that hardly change move the light one a
    // lot.
    report.converged = velocity_tolerance > 0.0
                           ? fastest <= std::max(velocity_tolerance, kReduction * first)
                           : report.residual <= tolerance;
    if (!report.converged && report.iterations < max_iterations)
      extrapolation.apply(before, rows, velocity);
  }
  return report;
}

Eigen::Matrix3d contactFrame(const Eigen::Vector3d& normal) {
  Eigen::Matrix3d frame;
  frame.row(0) = normal.transpose();
  frame.row(1) = normal.unitOrthogonal().transpose();
  frame.row(2) = normal.cross(frame.row(1).transpose()).transpose();
  return frame;
}

}  // namespace calipso::fem

#pragma once

#include <Eigen/Core>
#include <vector>

// Unilateral contact with Coulomb friction (Saupin et al. 2008), solved by block Gauss-Seidel on
//   u = u_free + W (p - p_start),   0 <= u_n  _|_  p_n >= 0,   |p_t| <= mu p_n opposite to sliding,
//  symbol   code          meaning                                                    unit
//  u        velocity      relative velocity in the contact's frame, normal first     m/s
//  p        impulse       impulse in the contact's frame                             N s
//  W        W             compliance H A^-1 H^T, 3c x 3c                             m/s per N s
// The normal component of u_free contains gap / h, so that u_n >= 0 keeps the surfaces apart at the
// end of the step.
namespace calipso::fem {

struct ContactRow {
  Eigen::Vector3d free_velocity = Eigen::Vector3d::Zero();
  Eigen::Vector3d start_impulse = Eigen::Vector3d::Zero();  // already contained in free_velocity
  Eigen::Vector3d impulse = Eigen::Vector3d::Zero();        // in: first guess; out: solution
  double friction = 0.0;
  // What held the object in the video beyond a contact's abilities, N s: the cone is shifted to
  // p_n >= -held_normal, |p_t| <= mu (p_n + held_normal) + held_tangential.
  double held_normal = 0.0;
  double held_tangential = 0.0;
};

struct ContactSolveReport {
  int iterations = 0;
  double residual = 0.0;  // largest change of an impulse in the last sweep over the largest impulse
  bool converged = false;
};

// Ends when no relative velocity changes by more than velocity_tolerance (m/s) in a sweep; without
// one, when the impulses change by less than `tolerance` (relative).
// @pre W is symmetric, positive semi-definite, with positive diagonal blocks
ContactSolveReport solveContacts(const Eigen::MatrixXd& W, std::vector<ContactRow>& rows,
                                 int max_iterations, double tolerance,
                                 double velocity_tolerance = 0.0);

// Right-handed orthonormal frame as rows: normal, then two tangents.
Eigen::Matrix3d contactFrame(const Eigen::Vector3d& normal);

}  // namespace calipso::fem

#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "calipso_fem/condensed_factor.hpp"
#include "calipso_fem/deformable_body.hpp"

namespace calipso::fem {

// The system a deformable body iterates with while it has contacts: the tangent A of some trial,
// kept from step to step and turned with the body, condensed onto the nodes that contacts act on.
// Directions, and the compliance that contact forces are found with, come from the same matrix, so
// that a direction obeys the contacts' laws however old the matrix is.
class SoftSystem {
 public:
  bool serves(const std::vector<int>& nodes, double h) const;
  // Takes A at the body's running trial; `rotation` is the body's, at the step's start.
  // nodes: ascending. @throw std::runtime_error when A is not positive definite
  void renew(DeformableBody& body, const Eigen::Matrix3d& rotation, const std::vector<int>& nodes,
             double h);
  void turnTo(const Eigen::Matrix3d& rotation, bool held);  // held: has prescribed components
  void forget() { valid_ = false; }

  int indexOf(int node) const { return factor_.indexOf(node); }
  // Of the contact nodes, in the axes of the factor; turn() leads to the world's.
  const Eigen::MatrixXd& compliance();
  const Eigen::Matrix3d& turn() const { return turn_; }
  int version() const { return version_; }  // changes with every renewal

  // Way of the contact nodes under `forces` (3n, N) alone, 3m, m. What contact forces add comes by:
  Vec reduce(const Vec& forces);
  // The direction under the forces of reduce() and these, 3n, N; zero at all but contact nodes.
  // What nothing holds gets its momentum exactly, whatever the factor's rounding.
  Vec complete(const Vec& contact_forces);
  // What the last renewal's prescribed way asks of the others, N; for the first direction after it.
  const Vec& pull() const { return pull_; }

 private:
  CondensedFactor factor_;
  BlockMatrix A_;
  Vec pull_;
  Eigen::MatrixX3d shifted_;  // A times a shift along each axis
  // sum of the forces of reduce(), in the factor's axes
  Eigen::Vector3d push_ = Eigen::Vector3d::Zero();
  std::vector<int> held_;       // prescribed components among those of the contact nodes
  Eigen::MatrixXd compliance_;  // of a body that has some
  Eigen::Matrix3d frozen_ = Eigen::Matrix3d::Identity(), turn_ = Eigen::Matrix3d::Identity();
  double h_ = 0.0;
  int version_ = 0;
  int indefinite_ = 0;  // renewals to come for which the exact tangent is not tried
  bool valid_ = false;
};

}  // namespace calipso::fem

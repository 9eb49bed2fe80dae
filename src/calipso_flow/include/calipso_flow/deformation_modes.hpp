#pragma once

#include <Eigen/Core>
#include <vector>

#include "calipso_flow/deformable_tracker.hpp"

namespace calipso::flow {

// The few coarse shapes in which an object deforms over a clip:
//   u(X, t) = sum_m q_m(t) phi_m(X),   from the shape in the key frame.
struct DeformationModes {
  Eigen::MatrixXd shapes;      // phi, 3 #V x K, object frame; root mean square over the vertices: 1
  Eigen::MatrixXd amplitudes;  // q, T x K, m
  Eigen::MatrixXd deviations;  // of q, T x K, m
  Eigen::MatrixXd velocities;  // T x K, m/s

  int count() const { return static_cast<int>(shapes.cols()); }
  // Displaced vertices, object frame. @param amplitudes  K
  decltype(TriangleMesh::vertices) surface(const TriangleMesh& mesh,
                                           const Eigen::VectorXd& amplitudes) const;
};

// Principal components of the observed displacements, strongest first; those that do not rise above
// the uncertainty of the observations are left out, so that there may be none. Frames without an
// observation are interpolated.
// @param weights  of the field at the model's vertices
DeformationModes modesOf(const std::vector<DeformationObservation>& observations,
                         const DeformationField::Weights& weights);

}  // namespace calipso::flow

#pragma once

#include <Eigen/Core>
#include <vector>

namespace calipso::flow {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Tracks of one picture: residuals r and their Jacobians A by the pose, in units of the deviations
// that the matches state.
struct WhitenedTracks {
  std::vector<Eigen::Vector2d> pixel, residual;
  std::vector<Eigen::Matrix<double, 2, 6>> jacobian;
};

// Covariance of sum_i A_i^T r_i.
struct SharedError {
  Matrix6d alone = Matrix6d::Zero();     // of noise: another in every picture
  Matrix6d together = Matrix6d::Zero();  // of the model's shape: stays from picture to picture
};

// What tracks err by together does not average out. Patches that overlap share their pixels' noise;
// a model whose shape is not the true one puts neighbours off alike, however small the patches. The
// residuals of tracks i and j, d apart, have the covariance
//   s o_ij + c k_ij,  o = the share of a patch that they overlap by, k = exp(-d^2 / 2 l^2),
// l a part of the tracks' spread; s and c are what the products of residuals say by least squares.
// Where all patches overlap the two cannot be told apart: then it is taken for the shape's error.
// @param deviation  of the residuals, robust, 1 = as the matches state
// @param side  of the patches, px; 0: none overlap
SharedError sharedError(const WhitenedTracks& tracks, double deviation, double side);

}  // namespace calipso::flow

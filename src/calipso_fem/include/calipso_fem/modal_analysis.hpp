#pragma once

#include <vector>

#include "calipso_fem/elastic_model.hpp"

namespace calipso::fem {

// Small vibrations about the rest shape: K phi = omega^2 M phi.
struct ModalResult {
  Eigen::VectorXd frequencies;  // Hz, ascending
  Eigen::MatrixXd modes;        // 3n x count, M-orthonormal; zero at fixed components
  int iterations = 0;
  bool converged = false;
};

// The `count` lowest modes, by subspace iteration with a Cholesky factor of K. `fixed_dofs`
// (3 node + axis) must leave no rigid motion free.
// @throw std::invalid_argument for bad arguments, std::runtime_error where K is singular
ModalResult naturalFrequencies(const ElasticModel& model, const std::vector<int>& fixed_dofs,
                               int count, bool lumped_mass);

}  // namespace calipso::fem

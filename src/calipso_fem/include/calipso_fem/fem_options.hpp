#pragma once

#include <string>

#include "calipso_fem/elastic_model.hpp"

namespace calipso::fem {

enum class TimeScheme { kBackwardEuler, kTrapezoidal, kBdf2 };

enum class SolverKind {
  kAutomatic,           // by size
  kCholesky,            // CHOLMOD, symbolic analysis kept
  kJacobi,              // CG, 3x3-block Jacobi
  kIncompleteCholesky,  // CG, block incomplete Cholesky without fill
  kStaleCholesky,       // CG, factor of an earlier step
  kMultigrid            // CG, geometric multigrid on the voxel hierarchy
};

std::string toString(SolverKind solver);
SolverKind solverKindFromString(const std::string& name);  // @throw std::invalid_argument
std::string toString(TimeScheme scheme);

// How a body is discretised and solved.
struct FemOptions {
  int target_nodes = 1500;
  double cell_size = 0.0;   // m; > 0 overrides target_nodes
  bool has_anchor = false;  // a lattice plane of each axis passes through `anchor`
  Eigen::Vector3d anchor = Eigen::Vector3d::Zero();  // m
  ElementType element = ElementType::kHexEnhanced;
  MaterialModel material_model = MaterialModel::kStVenantKirchhoff;
  TimeScheme scheme = TimeScheme::kBackwardEuler;
  bool lumped_mass = true;
  double mass_damping = 0.0;  // Rayleigh, 1/s; stiffness damping is Material::damping

  // One iteration without line search is the linearised step of eq. 13.
  bool linearised = false;
  int newton_iterations = 20;
  double newton_tolerance = 1e-4;   // residual / (loads and inner forces)
  int static_load_steps = 1;        // more are taken when Newton does not converge,
  int static_most_load_steps = 64;  // up to so many

  SolverKind solver = SolverKind::kAutomatic;
  double linear_tolerance = 1e-5;  // CG, relative residual
  int linear_iterations = 1000;
  int threads = 2;
};

// @throw std::invalid_argument naming option, value and range
void validate(const FemOptions& options);

}  // namespace calipso::fem

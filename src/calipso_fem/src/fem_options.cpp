#include "calipso_fem/fem_options.hpp"

#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace calipso::fem {
namespace {

constexpr std::array<std::pair<SolverKind, const char*>, 6> kSolvers = {{
    {SolverKind::kAutomatic, "automatic"},
    {SolverKind::kCholesky, "cholesky"},
    {SolverKind::kJacobi, "jacobi"},
    {SolverKind::kIncompleteCholesky, "incomplete_cholesky"},
    {SolverKind::kStaleCholesky, "stale_cholesky"},
    {SolverKind::kMultigrid, "multigrid"},
}};

constexpr std::array<std::pair<TimeScheme, const char*>, 3> kSchemes = {{
    {TimeScheme::kBackwardEuler, "backward_euler"},
    {TimeScheme::kTrapezoidal, "trapezoidal"},
    {TimeScheme::kBdf2, "bdf2"},
}};

template <class Table, class Value>
std::string nameOf(const Table& table, Value value) {
  for (const auto& [known, name] : table)
    if (known == value) return name;
  return "unknown";
}

void require(bool ok, const std::string& name, double value, const std::string& range) {
  if (!ok)
    throw std::invalid_argument("FEM option " + name + " is " + std::to_string(value) +
                                ", allowed is " + range);
}

}  // namespace

std::string toString(SolverKind solver) { return nameOf(kSolvers, solver); }
SolverKind solverKindFromString(const std::string& name) {
  std::string allowed;
  for (const auto& [solver, known] : kSolvers) {
    if (name == known) return solver;
    allowed += (allowed.empty() ? "" : ", ") + std::string(known);
  }
  throw std::invalid_argument("solver '" + name + "': known are " + allowed);
}
std::string toString(TimeScheme scheme) { return nameOf(kSchemes, scheme); }

void validate(const FemOptions& o) {
  require(o.cell_size > 0.0 || o.target_nodes >= 8, "target_nodes", o.target_nodes, ">= 8");
  require(o.cell_size >= 0.0 && std::isfinite(o.cell_size), "cell_size", o.cell_size, ">= 0 m");
  if (o.has_anchor && !o.anchor.allFinite())
    throw std::invalid_argument(
        "FEM option anchor: a component is not finite, allowed is any point");
  require(o.mass_damping >= 0.0 && std::isfinite(o.mass_damping), "mass_damping", o.mass_damping,
          ">= 0 1/s");
  require(o.newton_iterations >= 1, "newton_iterations", o.newton_iterations, ">= 1");
  require(o.newton_tolerance > 0.0 && std::isfinite(o.newton_tolerance), "newton_tolerance",
          o.newton_tolerance, "> 0");
  require(o.linear_tolerance > 0.0 && o.linear_tolerance < 1.0, "linear_tolerance",
          o.linear_tolerance, "(0, 1)");
  require(o.linear_iterations >= 1, "linear_iterations", o.linear_iterations, ">= 1");
  require(o.static_load_steps >= 1, "static_load_steps", o.static_load_steps, ">= 1");
  require(o.threads >= 1, "threads", o.threads, ">= 1");
}

}  // namespace calipso::fem

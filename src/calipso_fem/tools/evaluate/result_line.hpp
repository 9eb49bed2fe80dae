#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

namespace calipso::fem {

// One result of the evaluator: a computed quantity beside its reference.
struct ResultLine {
  std::string case_name;
  std::string kind;        // same_discretisation or default
  std::string element, material, solver;
  int nodes = 0;
  std::string quantity;
  Eigen::VectorXd value, reference;   // one number, or several
  int steps = 0;
  double ms_per_step = 0.0;
  int newton_iterations = 0;
  int cg_iterations = 0;
  std::optional<double> error;        // where it is not that of the vectors above

  double relativeError() const;       // |value - reference| / |reference|
};

// One JSON object on one line of standard output.
void print(const ResultLine& line);

Eigen::VectorXd scalar(double value);

}  // namespace calipso::fem

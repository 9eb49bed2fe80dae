#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <optional>
#include <string>

namespace calipso::fem {

// One result of the evaluator: a computed quantity beside its reference.
struct ResultLine {
  std::string case_name;
  std::string kind;  // same_discretisation or default
  std::string element, material, solver;
  int nodes = 0;
  std::string quantity;
  Eigen::VectorXd value, reference;  // one number, or several
  int steps = 0;
  double ms_per_step = 0.0;
  int newton_iterations = 0;
  int cg_iterations = 0;
  std::optional<double> error;  // where it is not that of the vectors above

  double relativeError() const;  // |value - reference| / |reference|
};

// One JSON object on one line of standard output.
void print(const ResultLine& line);
// The same with quantity, value and reference (a number or a list) put in.
void printQuantity(ResultLine line, const std::string& quantity, const Eigen::VectorXd& value,
                   const YAML::Node& reference);

Eigen::VectorXd scalar(double value);

}  // namespace calipso::fem

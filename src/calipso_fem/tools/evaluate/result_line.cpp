#include "result_line.hpp"

#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "case_reader.hpp"

namespace calipso::fem {
namespace {

std::string number(double value) {
  if (!std::isfinite(value)) return "null";
  char text[32];
  std::snprintf(text, sizeof text, "%.12g", value);
  return text;
}

std::string json(const Eigen::VectorXd& v) {
  if (v.size() == 1) return number(v[0]);
  std::string text = "[";
  for (Eigen::Index k = 0; k < v.size(); ++k) text += (k ? ", " : "") + number(v[k]);
  return text + "]";
}

}  // namespace

double ResultLine::relativeError() const {
  if (error) return *error;
  const double scale = reference.norm();
  return (value - reference).norm() / (scale > 0.0 ? scale : 1.0);
}

void print(const ResultLine& r) {
  std::printf(
      "{\"case\": \"%s\", \"kind\": \"%s\", \"element\": \"%s\", \"material\": \"%s\", "
      "\"solver\": \"%s\", \"nodes\": %d, \"quantity\": \"%s\", \"value\": %s, \"reference\": %s, "
      "\"rel_error\": %s, \"steps\": %d, \"ms_per_step\": %s, \"newton_iterations\": %d, "
      "\"cg_iterations\": %d}\n",
      r.case_name.c_str(), r.kind.c_str(), r.element.c_str(), r.material.c_str(), r.solver.c_str(),
      r.nodes, r.quantity.c_str(), json(r.value).c_str(), json(r.reference).c_str(),
      number(r.relativeError()).c_str(), r.steps, number(r.ms_per_step).c_str(),
      r.newton_iterations, r.cg_iterations);
  std::fflush(stdout);
}

void printQuantity(ResultLine line, const std::string& quantity, const Eigen::VectorXd& value,
                   const YAML::Node& reference) {
  line.quantity = quantity;
  line.value = value;
  line.reference = readVector(reference);
  if (line.reference.size() != value.size())
    throw std::runtime_error(line.case_name + ": " + quantity + ": the reference has " +
                             std::to_string(line.reference.size()) + " numbers, expected " +
                             std::to_string(value.size()));
  print(line);
}

Eigen::VectorXd scalar(double value) { return Eigen::VectorXd::Constant(1, value); }

}  // namespace calipso::fem

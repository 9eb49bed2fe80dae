#pragma once

#include <Eigen/Core>
#include <vector>

namespace calipso::flow {

// A velocity of the air that is linear between knots. World axes.
struct WindCourse {
  std::vector<double> knots;          // s, ascending
  std::vector<Eigen::Vector3d> wind;  // m/s, at the knots

  double weight(size_t knot, double time) const;  // of a knot's value at a time; they add up to one
  Eigen::Vector3d at(double time) const;
};

}  // namespace calipso::flow

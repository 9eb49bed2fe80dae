#pragma once

#include <Eigen/Core>
#include <deque>
#include <optional>

namespace calipso::fem {

// Anderson acceleration of a fixed-point iteration x -> g(x): the next x is the combination of the
// last g's for which the same combination of g(x) - x is least (Walker and Ni 2011, type II).
class Anderson {
 public:
  // What comes along (same length every time) is combined like g.
  // @return next x and what came along; nothing until there are two
  std::optional<std::pair<Eigen::VectorXd, Eigen::VectorXd>> next(const Eigen::VectorXd& x,
                                                                  const Eigen::VectorXd& g,
                                                                  const Eigen::VectorXd& along);
  void reset() { points_.clear(); }

 private:
  struct Point {
    Eigen::VectorXd g, change, along;
  };
  std::deque<Point> points_;
};

}  // namespace calipso::fem

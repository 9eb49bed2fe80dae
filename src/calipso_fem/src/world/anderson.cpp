#include "anderson.hpp"

#include <Eigen/Cholesky>

namespace calipso::fem {

std::optional<std::pair<Eigen::VectorXd, Eigen::VectorXd>> Anderson::next(
    const Eigen::VectorXd& x, const Eigen::VectorXd& g, const Eigen::VectorXd& along) {
  constexpr std::size_t kWindow = 6;
  constexpr double kDamping = 1e-10;  // of the normal equations' trace
  points_.push_back({g, g - x, along});
  if (points_.size() > kWindow) points_.pop_front();
  const auto m = static_cast<Eigen::Index>(points_.size()) - 1;
  if (m == 0) return std::nullopt;
  const Point& last = points_.back();
  Eigen::MatrixXd D(g.size(), m);
  for (Eigen::Index j = 0; j < m; ++j) D.col(j) = last.change - points_[j].change;
  Eigen::MatrixXd N = D.transpose() * D;
  N.diagonal().array() += kDamping * N.trace();
  const Eigen::VectorXd w = N.ldlt().solve(D.transpose() * last.change);
  if (!w.allFinite()) return std::nullopt;
  std::pair<Eigen::VectorXd, Eigen::VectorXd> result{last.g, last.along};
  for (Eigen::Index j = 0; j < m; ++j) {
    result.first += w[j] * (points_[j].g - last.g);
    result.second += w[j] * (points_[j].along - last.along);
  }
  return result;
}

}  // namespace calipso::fem

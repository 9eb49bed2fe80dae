#include "field_metric.hpp"

namespace calipso::flow {
namespace {

constexpr double kRidge = 1e-9;  // controls that no vertex sees have no length of their own

}  // namespace

Eigen::MatrixXd meanSquare(const DeformationField::Weights& weights) {
  const Eigen::MatrixXd scalar =
      Eigen::MatrixXd(weights.transpose() * weights) / static_cast<double>(weights.rows());
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(3 * scalar.rows(), 3 * scalar.cols());
  for (int i = 0; i < scalar.rows(); ++i) {
    for (int j = 0; j < scalar.cols(); ++j) {
      for (int a = 0; a < 3; ++a) G(3 * i + a, 3 * j + a) = scalar(i, j);
    }
  }
  G.diagonal().array() += kRidge;
  return G;
}

Eigen::VectorXd vertexShape(const DeformationField::Weights& weights,
                            const Eigen::VectorXd& controls) {
  const Eigen::Map<const DeformationField::Points> c(controls.data(), controls.size() / 3, 3);
  const DeformationField::Points shape = weights * c;
  return Eigen::Map<const Eigen::VectorXd>(shape.data(), shape.size());
}

}  // namespace calipso::flow

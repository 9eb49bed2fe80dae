#include "calipso_flow/deformation_modes.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace calipso::flow {
namespace {

constexpr int kMostModes = 8;
constexpr double kLeastSignal = 3.0;  // root mean square amplitude over its deviation
constexpr double kLeastShare = 0.02;  // of the strongest mode's amplitude
constexpr int kHalfWindow = 2;        // frames on either side that a velocity is taken from
constexpr double kRidge = 1e-9;       // controls that no vertex sees have no length of their own

// G of the mean square displacement over the vertices, c^T G c.
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

void interpolateGaps(const std::vector<DeformationObservation>& observations,
                     Eigen::MatrixXd& values) {
  int before = 0;  // the key frame is always known
  for (int k = 1; k < values.rows(); ++k) {
    if (!observations[k].found) continue;
    const double span = observations[k].time - observations[before].time;
    for (int gap = before + 1; gap < k; ++gap) {
      const double share = (observations[gap].time - observations[before].time) / span;
      values.row(gap) = (1.0 - share) * values.row(before) + share * values.row(k);
    }
    before = k;
  }
  for (int k = before + 1; k < values.rows(); ++k) values.row(k) = values.row(before);
}

// Slope of the parabola through a frame and its neighbours in time.
Eigen::MatrixXd slopes(const std::vector<DeformationObservation>& observations,
                       const Eigen::MatrixXd& values) {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(values.rows(), values.cols());
  const int count = static_cast<int>(values.rows());
  if (count < 2) return result;
  for (int k = 0; k < count; ++k) {
    const int first = std::max(0, k - kHalfWindow), last = std::min(count - 1, k + kHalfWindow);
    const int terms = std::min(3, last - first + 1);
    Eigen::MatrixXd A(last - first + 1, terms);
    for (int i = first; i <= last; ++i) {
      const double t = observations[i].time - observations[k].time;
      for (int p = 0; p < terms; ++p) A(i - first, p) = std::pow(t, p);
    }
    const Eigen::MatrixXd fit =
        A.colPivHouseholderQr().solve(values.middleRows(first, last - first + 1));
    result.row(k) = fit.row(1);
  }
  return result;
}

}  // namespace

decltype(TriangleMesh::vertices) DeformationModes::surface(const TriangleMesh& mesh,
                                                           const Eigen::VectorXd& q) const {
  const Eigen::VectorXd u = shapes * q;
  return mesh.vertices + Eigen::Map<const DeformationField::Points>(u.data(), u.size() / 3, 3);
}

DeformationModes modesOf(const std::vector<DeformationObservation>& observations,
                         const DeformationField::Weights& weights) {
  const int frames = static_cast<int>(observations.size());
  const int size = static_cast<int>(observations.front().controls.size());
  Eigen::MatrixXd controls = Eigen::MatrixXd::Zero(frames, size);
  for (int k = 0; k < frames; ++k) {
    if (observations[k].found) controls.row(k) = observations[k].controls.transpose();
  }
  interpolateGaps(observations, controls);

  // Principal components in the metric of G = L L^T.
  const Eigen::MatrixXd G = meanSquare(weights);
  const Eigen::LLT<Eigen::MatrixXd> factor(G);
  const Eigen::MatrixXd scaled = controls * Eigen::MatrixXd(factor.matrixL());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled.transpose() * scaled / frames);

  DeformationModes modes;
  modes.shapes.resize(3 * weights.rows(), 0);
  modes.amplitudes = modes.deviations = Eigen::MatrixXd(frames, 0);
  for (int m = 0; m < std::min(kMostModes, size); ++m) {
    const Eigen::VectorXd y = solver.eigenvectors().col(size - 1 - m);
    const double strength = std::sqrt(std::max(0.0, solver.eigenvalues()[size - 1 - m]));
    const Eigen::VectorXd dual = factor.matrixL() * y;  // q = controls . dual
    Eigen::VectorXd deviations = Eigen::VectorXd::Zero(frames);
    double variance = 0.0;
    for (int k = 0; k < frames; ++k) {
      if (!observations[k].found || observations[k].covariance.size() == 0) continue;
      const double v = dual.dot(observations[k].covariance * dual);
      deviations[k] = std::sqrt(std::max(0.0, v));
      variance += v / frames;
    }
    const double strongest = std::sqrt(std::max(0.0, solver.eigenvalues()[size - 1]));
    if (strength < kLeastSignal * std::sqrt(variance) || strength < kLeastShare * strongest) break;
    const int n = modes.count();
    modes.shapes.conservativeResize(Eigen::NoChange, n + 1);
    modes.amplitudes.conservativeResize(Eigen::NoChange, n + 1);
    modes.deviations.conservativeResize(Eigen::NoChange, n + 1);
    modes.shapes.col(n) = vertexShape(weights, factor.matrixU().solve(y));
    modes.amplitudes.col(n) = controls * dual;
    modes.deviations.col(n) = deviations;
  }
  modes.velocities = slopes(observations, modes.amplitudes);
  return modes;
}

}  // namespace calipso::flow

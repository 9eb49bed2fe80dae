#include "calipso_flow/deformation_modes.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "field_metric.hpp"

namespace calipso::flow {
namespace {

constexpr int kMostModes = 8;
constexpr double kLeastSignal = 3.0;  // root mean square amplitude over its deviation
constexpr double kLeastShare = 0.02;  // of the strongest mode's amplitude
constexpr int kHalfWindow = 2;        // frames on either side that a velocity is taken from

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

// One row per frame.
Eigen::MatrixXd controlSeries(const std::vector<DeformationObservation>& observations) {
  Eigen::MatrixXd controls =
      Eigen::MatrixXd::Zero(observations.size(), observations.front().controls.size());
  for (size_t k = 0; k < observations.size(); ++k) {
    if (observations[k].found) controls.row(k) = observations[k].controls.transpose();
  }
  interpolateGaps(observations, controls);
  return controls;
}

// The projection of controls (rows) on what rises above the uncertainty of their observation: the
// principal components of the series whitened by its mean covariance C = L L^T. What is seen badly,
// such as depth, counts only as far as it goes with what is seen well. Of T frames of pure noise in
// n unknowns the largest eigenvalue is (1 + sqrt(n / T))^2 (Marchenko and Pastur).
Eigen::MatrixXd aboveNoise(const std::vector<DeformationObservation>& observations,
                           const Eigen::MatrixXd& controls) {
  const Eigen::Index size = controls.cols();
  Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(size, size);
  int seen = 0;
  for (const DeformationObservation& o : observations) {
    if (o.found && o.covariance.size() > 0 && !o.covariance.isZero()) noise += o.covariance, ++seen;
  }
  if (seen == 0) return Eigen::MatrixXd::Identity(size, size);
  const Eigen::LLT<Eigen::MatrixXd> factor(noise / seen);
  const auto L = factor.matrixL();
  const Eigen::MatrixXd white = L.solve(controls.transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(white * white.transpose() / seen);
  const double chance = 1.0 + std::sqrt(static_cast<double>(size) / seen);
  const double least = kLeastSignal * chance * chance;
  const Eigen::Index first = (solver.eigenvalues().array() <= least).count();
  const Eigen::MatrixXd W = solver.eigenvectors().rightCols(size - first);
  return factor.matrixU().solve(W) * (W.transpose() * Eigen::MatrixXd(factor.matrixU()));
}

// Of controls . dual, per frame.
Eigen::VectorXd deviationsOf(const std::vector<DeformationObservation>& observations,
                             const Eigen::VectorXd& dual) {
  Eigen::VectorXd deviations = Eigen::VectorXd::Zero(observations.size());
  for (size_t k = 0; k < observations.size(); ++k) {
    if (!observations[k].found || observations[k].covariance.size() == 0) continue;
    deviations[k] = std::sqrt(std::max(0.0, dual.dot(observations[k].covariance * dual)));
  }
  return deviations;
}

// Slope of the cubic through a frame and its neighbours in time: in their midst a parabola's is that
// of a straight line, a third too low for what swings in 8 frames.
Eigen::MatrixXd slopes(const std::vector<DeformationObservation>& observations,
                       const Eigen::MatrixXd& values) {
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(values.rows(), values.cols());
  const int count = static_cast<int>(values.rows());
  if (count < 2) return result;
  for (int k = 0; k < count; ++k) {
    const int first = std::max(0, k - kHalfWindow), last = std::min(count - 1, k + kHalfWindow);
    const int terms = std::min(4, last - first + 1);
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
  const Eigen::MatrixXd controls = controlSeries(observations);
  const Eigen::MatrixXd clear = aboveNoise(observations, controls);

  // Principal components in the metric of G = L L^T.
  const Eigen::LLT<Eigen::MatrixXd> factor(meanSquare(weights));
  const Eigen::MatrixXd scaled = controls * clear * Eigen::MatrixXd(factor.matrixL());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled.transpose() * scaled / frames);
  const auto strengthOf = [&](int m) {
    return std::sqrt(std::max(0.0, solver.eigenvalues()[size - 1 - m]));
  };

  DeformationModes modes;
  modes.shapes.resize(3 * weights.rows(), 0);
  modes.amplitudes = modes.deviations = Eigen::MatrixXd(frames, 0);
  for (int m = 0; m < std::min(kMostModes, size); ++m) {
    const Eigen::VectorXd y = solver.eigenvectors().col(size - 1 - m);
    const Eigen::VectorXd dual = clear * (factor.matrixL() * y);  // q = controls . dual
    const Eigen::VectorXd deviations = deviationsOf(observations, dual);
    const double noise = std::sqrt(deviations.squaredNorm() / frames);
    if (strengthOf(m) < kLeastSignal * noise || strengthOf(m) <= kLeastShare * strengthOf(0)) break;
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

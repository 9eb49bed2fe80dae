#include "calipso_flow/shading.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <complex>

namespace calipso::flow {
namespace {

constexpr int kMostComponents = 4;
constexpr double kLeastSignal = 4.0;  // amplitude over its noise
constexpr double kLeastSeen = 0.8;    // share of the frames in which a point must be found
constexpr double kUsualNoise = 3e-3;  // of the logarithm; estimates below are chance
constexpr int kSteps = 24;            // of the search on either side of zero
constexpr int kRefinements = 4;

// T x P, about each point's mean; zero where a point is seen too seldom.
Eigen::MatrixXd seriesOf(const std::vector<DeformationObservation>& observations) {
  Eigen::Index points = 0;
  for (const DeformationObservation& o : observations) {
    points = std::max(points, o.brightness.size());
  }
  const Eigen::Index frames = observations.size();
  Eigen::MatrixXd series = Eigen::MatrixXd::Zero(frames, points);
  for (Eigen::Index p = 0; p < points; ++p) {
    int seen = 0;
    double last = 0.0;  // stands for the frames up to the next in which the point is found
    for (Eigen::Index k = 0; k < frames; ++k) {
      const Eigen::VectorXd& b = observations[k].brightness;
      if (b.size() == 0) {
        ++seen, last = 0.0;  // the key frame, or one like it
      } else if (std::isfinite(b[p])) {
        ++seen, last = b[p];
      }
      series(k, p) = last;
    }
    if (seen < kLeastSeen * frames) {
      series.col(p).setZero();
    } else {
      series.col(p).array() -= series.col(p).mean();
    }
  }
  return series;
}

}  // namespace

// From second differences in time, whose variance is six times that of the noise.
double noiseOf(const Eigen::VectorXd& series) {
  const Eigen::Index n = series.size();
  if (n < 5) return 0.0;
  std::vector<double> second(n - 2);
  for (Eigen::Index k = 0; k + 2 < n; ++k)
    second[k] = std::abs(series[k] - 2.0 * series[k + 1] + series[k + 2]);
  std::nth_element(second.begin(), second.begin() + second.size() / 2, second.end());
  return 1.4826 * second[second.size() / 2] / std::sqrt(6.0);
}

Shading shadingOf(const std::vector<DeformationObservation>& observations) {
  const Eigen::MatrixXd series = seriesOf(observations);
  Shading shading;
  shading.shapes.resize(series.cols(), 0);
  shading.amplitudes.resize(series.rows(), 0);
  if (series.cols() == 0) return shading;
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(series, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const Eigen::MatrixXd amplitudes = svd.matrixU() * svd.singularValues().asDiagonal();
  shading.noise = kUsualNoise;
  const Eigen::Index most = std::min<Eigen::Index>(kMostComponents, amplitudes.cols());
  for (Eigen::Index m = 0; m < most; ++m)
    shading.noise = std::max(shading.noise, noiseOf(amplitudes.col(m)));
  Eigen::Index count = 0;
  while (count < most && svd.singularValues()[count] >
                             kLeastSignal * shading.noise * std::sqrt(double(series.rows()))) {
    ++count;
  }
  shading.shapes = svd.matrixV().leftCols(count);
  shading.amplitudes = amplitudes.leftCols(count);
  return shading;
}

PlaneWave planeWaveIn(const Eigen::Matrix<double, Eigen::Dynamic, 2>& points,
                      const Eigen::VectorXcd& field, double farthest) {
  const double total = field.cwiseAbs().sum();
  PlaneWave best;
  if (!(total > 0.0)) return best;
  const auto powerAt = [&](const Eigen::Vector2d& k) {
    std::complex<double> sum = 0.0;
    for (Eigen::Index i = 0; i < points.rows(); ++i)
      sum += field[i] * std::polar(1.0, points.row(i).dot(k.transpose()));
    return std::norm(sum) / (total * total);
  };
  double step = farthest / kSteps;
  std::vector<std::pair<Eigen::Vector2d, double>> tried;
  for (int a = -kSteps; a <= kSteps; ++a) {
    for (int b = -kSteps; b <= kSteps; ++b) {
      const Eigen::Vector2d k(a * step, b * step);
      tried.emplace_back(k, powerAt(k));
      if (tried.back().second > best.power) best.wave_vector = k, best.power = tried.back().second;
    }
  }
  for (const auto& [k, power] : tried) {
    if (k.dot(best.wave_vector) < 0.0) best.opposite = std::max(best.opposite, power);
  }
  for (int refinement = 0; refinement < kRefinements; ++refinement) {
    step *= 0.5;
    const Eigen::Vector2d centre = best.wave_vector;
    for (int a = -1; a <= 1; ++a) {
      for (int b = -1; b <= 1; ++b) {
        const Eigen::Vector2d k = centre + step * Eigen::Vector2d(a, b);
        const double power = powerAt(k);
        if (power > best.power) best.wave_vector = k, best.power = power;
      }
    }
  }
  return best;
}

}  // namespace calipso::flow

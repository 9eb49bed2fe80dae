#include "calipso_flow/vibration.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <complex>
#include <stdexcept>
#include <string>

namespace calipso::flow {
namespace {

constexpr double kTwoPi = 6.28318530717958647692;
constexpr int kGridPerBin = 8;  // candidates per resolvable frequency
constexpr int kRefinements = 40;
constexpr double kNyquistShare = 0.95;
// of the lowest candidate, and of the distance of two: what refinement may come to
constexpr double kLeastShare = 0.9;
constexpr double kMostDecay = 3.0;  // e-foldings within the clip

// Frequency and decay of one line.
struct Pole {
  double omega, decay;  // rad/s, 1/s
};

using Poles = std::vector<Pole>;

// Columns 1, exp(-decay t) cos(omega t), exp(-decay t) sin(omega t) of every pole.
Eigen::MatrixXd basis(const Eigen::VectorXd& t, const Poles& poles) {
  Eigen::MatrixXd A(t.size(), 1 + 2 * poles.size());
  A.col(0).setOnes();
  for (size_t j = 0; j < poles.size(); ++j) {
    const Eigen::ArrayXd fall = (-poles[j].decay * t.array()).exp();
    A.col(1 + 2 * j) = fall * (poles[j].omega * t.array()).cos();
    A.col(2 + 2 * j) = fall * (poles[j].omega * t.array()).sin();
  }
  return A;
}

Eigen::MatrixXd residual(const Eigen::VectorXd& t, const Eigen::MatrixXd& Y, const Poles& poles) {
  const Eigen::MatrixXd A = basis(t, poles);
  return Y - A * A.householderQr().solve(Y);
}

double span(const Eigen::VectorXd& t) { return t[t.size() - 1] - t[0]; }

// Degrees of freedom left for `count` poles over all series.
double freedom(const Eigen::MatrixXd& Y, size_t count) {
  return static_cast<double>(Y.size()) - Y.cols() * (1.0 + 2.0 * count) - 2.0 * count;
}

// The frequency whose line, added to `poles`, leaves the least.
Pole bestCandidate(const Eigen::VectorXd& t, const Eigen::MatrixXd& Y, const Poles& poles,
                   double lowest, double highest) {
  const double step = kTwoPi / span(t) / kGridPerBin;
  Pole best{0.0, 0.0};
  double least = residual(t, Y, poles).squaredNorm();
  for (double omega = lowest; omega <= highest; omega += step) {
    Poles tried = poles;
    tried.push_back({omega, 0.0});
    const bool taken = std::any_of(poles.begin(), poles.end(), [&](const Pole& p) {
      return std::abs(p.omega - omega) < kTwoPi / span(t);
    });
    if (taken) continue;  // what the clip cannot tell apart is one line
    const double left = residual(t, Y, tried).squaredNorm();
    if (left < least) least = left, best = tried.back();
  }
  return best;
}

Poles moved(const Poles& poles, const Eigen::VectorXd& step) {
  Poles result = poles;
  for (size_t j = 0; j < poles.size(); ++j) {
    result[j].omega += step[2 * j];
    result[j].decay += step[2 * j + 1];
  }
  return result;
}

// Derivatives of the projected residual by (omega, decay) of every pole, by central differences.
Eigen::MatrixXd jacobian(const Eigen::VectorXd& t, const Eigen::MatrixXd& Y, const Poles& poles) {
  const double small = 1e-4 / span(t);
  Eigen::MatrixXd J(Y.size(), 2 * poles.size());
  for (int p = 0; p < J.cols(); ++p) {
    const Eigen::VectorXd d = small * Eigen::VectorXd::Unit(J.cols(), p);
    const Eigen::MatrixXd change =
        residual(t, Y, moved(poles, d)) - residual(t, Y, moved(poles, -d));
    J.col(p) = Eigen::Map<const Eigen::VectorXd>(change.data(), change.size()) / (2.0 * small);
  }
  return J;
}

bool apart(const Poles& poles, double least) {
  for (size_t a = 0; a < poles.size(); ++a) {
    for (size_t b = 0; b < a; ++b) {
      if (std::abs(poles[a].omega - poles[b].omega) < least) return false;
    }
  }
  return true;
}

bool allowed(const Poles& poles, double lowest, double highest, double duration) {
  if (!apart(poles, kLeastShare * kTwoPi / duration)) return false;
  return std::all_of(poles.begin(), poles.end(), [&](const Pole& p) {
    return p.omega >= kLeastShare * lowest && p.omega <= highest &&
           std::abs(p.decay) * duration <= kMostDecay;
  });
}

// Levenberg-Marquardt over all poles.
Poles refine(const Eigen::VectorXd& t, const Eigen::MatrixXd& Y, Poles poles, double lowest,
             double highest) {
  double damping = 1e-3;
  double power = residual(t, Y, poles).squaredNorm();
  for (int iteration = 0; iteration < kRefinements; ++iteration) {
    const Eigen::MatrixXd r = residual(t, Y, poles);
    const Eigen::MatrixXd J = jacobian(t, Y, poles);
    Eigen::MatrixXd H = J.transpose() * J;
    H.diagonal() *= 1.0 + damping;
    const Eigen::VectorXd step =
        -H.ldlt().solve(J.transpose() * Eigen::Map<const Eigen::VectorXd>(r.data(), r.size()));
    if (!step.allFinite()) break;
    const Poles next = moved(poles, step);
    const double left = allowed(next, lowest, highest, span(t)) ? residual(t, Y, next).squaredNorm()
                                                                : 2.0 * power + 1.0;
    if (left < power) {
      poles = next, power = left, damping *= 0.3;
      if (step.cwiseAbs().maxCoeff() * span(t) < 1e-7) break;
    } else {
      damping *= 10.0;
      if (damping > 1e9) break;
    }
  }
  return poles;
}

// Improvement by the last pole over what is left, each per degree of freedom.
double qualityOf(const Eigen::VectorXd& t, const Eigen::MatrixXd& Y, const Poles& poles,
                 size_t index, double noise) {
  Poles without = poles;
  without.erase(without.begin() + index);
  const double left = residual(t, Y, poles).squaredNorm();
  const double gain = residual(t, Y, without).squaredNorm() - left;
  const double background = left / std::max(1.0, freedom(Y, poles.size())) + noise * noise;
  return gain / (2.0 * Y.cols() + 2.0) / std::max(background, 1e-300);
}

void check(const Eigen::VectorXd& times, const Eigen::MatrixXd& series) {
  if (times.size() != series.rows()) {
    throw std::invalid_argument("vibration: " + std::to_string(times.size()) + " times for " +
                                std::to_string(series.rows()) + " samples; give one time each");
  }
  for (int k = 1; k < times.size(); ++k) {
    if (!(times[k] > times[k - 1])) {
      throw std::invalid_argument(
          "vibration: sample " + std::to_string(k) + " at " + std::to_string(times[k]) +
          " s is not later than the one before; give them in order of time");
    }
  }
}

Spectrum describe(const Eigen::VectorXd& t, const Eigen::MatrixXd& Y, const Poles& poles,
                  double noise) {
  Spectrum spectrum;
  const Eigen::MatrixXd A = basis(t, poles);
  const Eigen::MatrixXd coefficients = A.householderQr().solve(Y);
  spectrum.mean = coefficients.row(0).transpose();
  const double left = residual(t, Y, poles).squaredNorm();
  spectrum.residual = std::sqrt(left / Y.size());
  if (poles.empty()) return spectrum;
  const Eigen::MatrixXd J = jacobian(t, Y, poles);
  const Eigen::MatrixXd covariance =
      (J.transpose() * J).ldlt().solve(Eigen::MatrixXd::Identity(J.cols(), J.cols())) * left /
      std::max(1.0, freedom(Y, poles.size()));
  for (size_t j = 0; j < poles.size(); ++j) {
    SpectralLine line;
    line.frequency = poles[j].omega / kTwoPi;
    line.deviation = std::sqrt(std::max(0.0, covariance(2 * j, 2 * j))) / kTwoPi;
    line.decay = poles[j].decay;
    line.quality = qualityOf(t, Y, poles, j, noise);
    // a cos + b sin = Re((a - i b) exp(i omega t))
    line.amplitude = coefficients.row(1 + 2 * j).transpose().cast<std::complex<double>>() -
                     std::complex<double>(0.0, 1.0) *
                         coefficients.row(2 + 2 * j).transpose().cast<std::complex<double>>();
    spectrum.lines.push_back(line);
  }
  // The strongest over the clip, its decay considered.
  const auto power = [&](const SpectralLine& line) {
    return line.amplitude.squaredNorm() * (-2.0 * line.decay * t.array()).exp().mean();
  };
  std::stable_sort(spectrum.lines.begin(), spectrum.lines.end(),
                   [&](const auto& a, const auto& b) { return power(a) > power(b); });
  return spectrum;
}

}  // namespace

double SpectralLine::naturalFrequency() const { return std::hypot(frequency, decay / kTwoPi); }

Spectrum findLines(const Eigen::VectorXd& times, const Eigen::MatrixXd& series,
                   const SpectrumParams& params) {
  check(times, series);
  if (series.cols() == 0 || times.size() < 6) {
    return {{}, series.colwise().mean().transpose(), 0.0};
  }
  const Eigen::VectorXd t = times.array() - times[0];
  std::vector<double> steps;
  for (int k = 1; k < t.size(); ++k) steps.push_back(t[k] - t[k - 1]);
  std::nth_element(steps.begin(), steps.begin() + steps.size() / 2, steps.end());
  const double lowest = params.least_periods * kTwoPi / span(t);
  const double highest = kNyquistShare * 0.5 * kTwoPi / steps[steps.size() / 2];

  Poles poles;
  while (static_cast<int>(poles.size()) < params.most_lines &&
         freedom(series, poles.size() + 1) > 0.0) {
    const Pole candidate = bestCandidate(t, series, poles, lowest, highest);
    if (candidate.omega == 0.0) break;
    Poles tried = poles;
    tried.push_back(candidate);
    tried = refine(t, series, tried, lowest, highest);
    if (qualityOf(t, series, tried, tried.size() - 1, params.noise) < params.least_quality) break;
    poles = tried;
  }
  return describe(t, series, poles, params.noise);
}

CrestTravel crestTravel(const TriangleMesh& mesh, const Eigen::VectorXcd& shape) {
  // Along the direction that moves most: a scalar field s.
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (int i = 0; i < mesh.vertexCount(); ++i) {
    const Eigen::Vector3cd u = shape.segment<3>(3 * i);
    squares += (u * u.adjoint()).real();
  }
  const Eigen::Vector3d along =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(squares).eigenvectors().col(2);
  const auto s = [&](int i) -> std::complex<double> {
    const Eigen::Vector3cd u = shape.segment<3>(3 * i);
    return u[0] * along[0] + u[1] * along[1] + u[2] * along[2];
  };
  // k = -Im(conj(s) grad s) / |s|^2, since s goes as exp(-i k.x) where crests travel along k.
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double power = 0.0, slope = 0.0;
  for (int f = 0; f < mesh.triangleCount(); ++f) {
    const Eigen::Vector3i c = mesh.triangles.row(f).transpose();
    const Eigen::Vector3d a = mesh.vertex(c[0]), b = mesh.vertex(c[1]), d = mesh.vertex(c[2]);
    const Eigen::Vector3d normal = (b - a).cross(d - a);
    const double doubled = normal.squaredNorm();
    if (doubled <= 0.0) continue;
    const Eigen::Vector3cd gradient = (normal.cross(d - b).cast<std::complex<double>>() * s(c[0]) +
                                       normal.cross(a - d).cast<std::complex<double>>() * s(c[1]) +
                                       normal.cross(b - a).cast<std::complex<double>>() * s(c[2])) /
                                      doubled;
    const std::complex<double> mean = (s(c[0]) + s(c[1]) + s(c[2])) / 3.0;
    const double area = std::sqrt(doubled);
    sum -= area * (std::conj(mean) * gradient).imag();
    slope += area * gradient.squaredNorm();
    power += area * std::norm(mean);
  }
  CrestTravel travel;
  if (!(power > 0.0 && slope > 0.0)) return travel;
  travel.wave_vector = sum / power;
  travel.travelling = std::min(1.0, travel.wave_vector.squaredNorm() * power / slope);
  return travel;
}

}  // namespace calipso::flow

#include "piece_fit.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace calipso::flow {
namespace {

// Noise densities tried, as shares of the prior deviation of acceleration and spin. What changes
// faster than the largest is a collision.
constexpr double kJerkShares[] = {0.003, 0.01, 0.03, 0.1, 0.3};
constexpr double kSpinShares[] = {0.003, 0.01, 0.03, 0.1, 0.3};

constexpr double kLeastNoiseScale = 0.3, kMostNoiseScale = 30.0;

// Fewer frames in a piece say nothing about how its acceleration or spin changes.
constexpr int kLeastForForced = 5;

int framesInPiece(const std::vector<PoseMeasurement>& measurements,
                  const std::vector<MotionPiece>& pieces, size_t index) {
  return static_cast<int>(
      std::count_if(measurements.begin(), measurements.end(), [&](const PoseMeasurement& m) {
        const bool begun = index == 0 || m.time >= pieces[index].start;
        const bool ended = index + 1 < pieces.size() && m.time >= pieces[index + 1].start;
        return m.valid && begun && !ended;
      }));
}

std::vector<MotionPiece> travelOptions(const MotionPiece& piece, const MotionPrior& prior,
                                       bool few) {
  std::vector<MotionPiece> options;
  for (Travel travel : {Travel::kRest, Travel::kUniform, Travel::kFreeFall, Travel::kAccelerated}) {
    if (travel == Travel::kFreeFall && prior.gravity.norm() == 0.0) continue;
    if (travel == Travel::kAccelerated && few) continue;
    options.push_back(piece);
    options.back().travel = travel;
  }
  if (few) return options;
  for (double share : kJerkShares) {
    options.push_back(piece);
    options.back().travel = Travel::kForced;
    options.back().jerk = share * prior.acceleration;
  }
  return options;
}

std::vector<MotionPiece> turningOptions(const MotionPiece& piece, const MotionPrior& prior,
                                        bool few) {
  std::vector<MotionPiece> options;
  for (Turning turning : {Turning::kNone, Turning::kSteady}) {
    options.push_back(piece);
    options.back().turning = turning;
  }
  if (few) return options;
  for (double share : kSpinShares) {
    options.push_back(piece);
    options.back().turning = Turning::kForced;
    options.back().spin_noise = share * prior.spin;
  }
  return options;
}

}  // namespace

void chooseKind(const std::vector<PoseMeasurement>& measurements, size_t index,
                const MotionPrior& prior, double noise_scale, std::vector<MotionPiece>& pieces) {
  const bool few = framesInPiece(measurements, pieces, index) < kLeastForForced;
  MotionPiece& piece = pieces[index];
  if (piece.travel == Travel::kForced && piece.jerk == 0.0) piece.jerk = 0.3 * prior.acceleration;
  if (piece.turning == Turning::kForced && piece.spin_noise == 0.0) {
    piece.spin_noise = 0.3 * prior.spin;
  }
  // All pairs: travel and turning hang together where the measurements' errors do.
  double best = -std::numeric_limits<double>::infinity();
  MotionPiece winner = piece;
  for (const MotionPiece& travels : travelOptions(piece, prior, few)) {
    for (const MotionPiece& option : turningOptions(travels, prior, few)) {
      piece = option;
      const double value = logLikelihood(measurements, pieces, prior, noise_scale);
      if (value > best) best = value, winner = option;
    }
  }
  piece = winner;
}

double chooseNoiseScale(const std::vector<PoseMeasurement>& measurements,
                        const std::vector<MotionPiece>& pieces, const MotionPrior& prior,
                        double start) {
  const auto score = [&](double log_scale) {
    return logLikelihood(measurements, pieces, prior, std::exp(log_scale));
  };
  const double now = std::log(start), least = std::log(kLeastNoiseScale),
               most = std::log(kMostNoiseScale);
  const Maximum best = maximise(score, std::max(least, now - 1.5), std::min(most, now + 1.5), 1.5);
  return std::exp(best.at);
}

double noiseScaleBetweenJumps(const std::vector<PoseMeasurement>& measurements) {
  constexpr double kQuartile = 1.2125;  // of chi-squared with 3 degrees of freedom
  constexpr size_t kLeastDifferences = 4;
  std::vector<double> squares;
  for (size_t k = 3; k < measurements.size(); ++k) {
    const PoseMeasurement* m = &measurements[k - 3];
    if (!(m[0].valid && m[1].valid && m[2].valid && m[3].valid)) continue;
    // Newton's weights of the third divided difference, for frames that need not be evenly spaced.
    Eigen::Vector3d difference = Eigen::Vector3d::Zero();
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    double later = 0.0;  // weight of a measurement and all after it, which share what drifts
    for (int i = 3; i >= 0; --i) {
      double weight = 1.0;
      for (int j = 0; j < 4; ++j) {
        if (j != i) weight /= m[i].time - m[j].time;
      }
      difference += weight * m[i].position;
      covariance += weight * weight * m[i].covariance.topLeftCorner<3, 3>();
      later += weight;
      if (i > 0) covariance += later * later * m[i].drift.topLeftCorner<3, 3>();
    }
    squares.push_back(difference.dot(covariance.ldlt().solve(difference)));
  }
  if (squares.size() < kLeastDifferences) return 1.0;
  const auto quartile = squares.begin() + squares.size() / 4;
  std::nth_element(squares.begin(), quartile, squares.end());
  return std::clamp(std::sqrt(*quartile / kQuartile), 1.0, kMostNoiseScale);
}

Maximum maximise(const std::function<double(double)>& score, double low, double high, double step) {
  Maximum best{0.5 * (low + high), -std::numeric_limits<double>::infinity()};
  if (!(high > low)) return {best.at, score(best.at)};
  const double grid = 0.1 * step;
  const int count = std::max(2, static_cast<int>(std::ceil((high - low) / grid)));
  for (int i = 0; i <= count; ++i) {
    const double at = low + (high - low) * i / count;
    const double value = score(at);
    if (value > best.value) best = {at, value};
  }
  // Golden section between the neighbours of the best grid point.
  double a = std::max(low, best.at - grid), b = std::min(high, best.at + grid);
  const double golden = 0.5 * (std::sqrt(5.0) - 1.0);
  double x1 = b - golden * (b - a), x2 = a + golden * (b - a);
  double f1 = score(x1), f2 = score(x2);
  while (b - a > 1e-3 * step) {
    if (f1 > f2) {
      b = x2, x2 = x1, f2 = f1, x1 = b - golden * (b - a), f1 = score(x1);
    } else {
      a = x1, x1 = x2, f1 = f2, x2 = a + golden * (b - a), f2 = score(x2);
    }
  }
  const Maximum refined = f1 > f2 ? Maximum{x1, f1} : Maximum{x2, f2};
  return refined.value > best.value ? refined : best;
}

}  // namespace calipso::flow

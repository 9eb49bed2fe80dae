#include "shared_error.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace calipso::flow {
namespace {

constexpr double kShapeLength = 2.5;  // of the tracks' spread over l
// deviations by which the shape's error must stand out of what chance makes
constexpr double kShapeSurprise = 1.0;
// of 2 l^2: tracks farther apart have neither in common; patches that are larger than that (of
// small objects) are taken for as small
constexpr double kShapeReach = 4.0;
// 12 / (12 - 6): a pose takes up six of the errors of six such patches
constexpr double kShapeAbsorbed = 2.0;
// pairs of wholly overlapping patches: as surely is noise taken for unshared beforehand
constexpr double kUnsharedBefore = 1.0;

double overlap(const Eigen::Vector2d& between, double side) {
  const Eigen::Array2d share = 1.0 - between.array().abs() / side;
  return share.minCoeff() > 0.0 ? share.prod() : 0.0;
}

double meanSquaredSpread(const std::vector<Eigen::Vector2d>& pixels) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& pixel : pixels) mean += pixel / pixels.size();
  double spread = 0.0;
  for (const Eigen::Vector2d& pixel : pixels) spread += (pixel - mean).squaredNorm();
  return spread / pixels.size();
}

// Sums over pairs of tracks; vectors hold (k, o).
struct Pairs {
  Eigen::Matrix2d told = Eigen::Vector2d(1e-9, kUnsharedBefore).asDiagonal();
  Eigen::Vector2d seen = Eigen::Vector2d::Zero();
  // sum_ij A_i^T A_j, times k or o; i = j only
  Matrix6d shape = Matrix6d::Zero(), noise = Matrix6d::Zero(), own = Matrix6d::Zero();
};

Pairs sumOverPairs(const WhitenedTracks& tracks, double side) {
  const double twice_length = 2.0 * meanSquaredSpread(tracks.pixel) / (kShapeLength * kShapeLength);
  Pairs sum;
  for (size_t i = 0; i < tracks.pixel.size(); ++i) {
    const Eigen::Matrix<double, 6, 2> own = tracks.jacobian[i].transpose();
    Eigen::Matrix<double, 2, 6> around = tracks.jacobian[i], below;
    below.setZero();
    for (size_t j = 0; j < tracks.pixel.size(); ++j) {
      const Eigen::Vector2d between = tracks.pixel[i] - tracks.pixel[j];
      const double squared = between.squaredNorm();
      if (j == i || squared > kShapeReach * twice_length) continue;
      const Eigen::Vector2d alike(std::exp(-squared / twice_length), overlap(between, side));
      around += alike.x() * tracks.jacobian[j];
      below += alike.y() * tracks.jacobian[j];
      if (j > i) continue;
      sum.told += alike * alike.transpose();
      sum.seen += 0.5 * tracks.residual[i].dot(tracks.residual[j]) * alike;
    }
    sum.own += own * tracks.jacobian[i];
    sum.shape += own * around;
    sum.noise += own * below;
  }
  return sum;
}

}  // namespace

SharedError sharedError(const WhitenedTracks& tracks, double deviation, double side) {
  const Pairs sum = sumOverPairs(tracks, side);
  const Eigen::Matrix2d covariance = sum.told.inverse();
  const Eigen::Vector2d found = covariance * sum.seen;  // c, s
  // The product of two independent residuals has the variance sigma^4, their mean over x and y half
  // of it.
  const double variance = deviation * deviation;
  const double chance = variance * std::sqrt(0.5 * covariance(0, 0));
  const double of_shape = found.x() > kShapeSurprise * chance ? kShapeAbsorbed * found.x() : 0.0;
  const double of_noise = std::max(1.0, variance - of_shape);
  return {of_noise * sum.own + std::clamp(found.y(), 0.0, of_noise) * sum.noise,
          of_shape * sum.shape};
}

}  // namespace calipso::flow

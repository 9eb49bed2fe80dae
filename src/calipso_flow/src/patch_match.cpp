#include "calipso_flow/patch_match.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "patch_kernel.hpp"

namespace calipso::flow {
namespace {

// A match whose contrast is a smaller share of the patch's shows another surface.
constexpr double kLeastGain = 0.2;

// Deviation along a patch's stripes: nothing is known.
constexpr double kAlongPx = 1e3;

// The patch as a linear model of what the target shows near the right place:
//   I(x + d) = gain T(x) + offset + ramp . x - gain grad T(x) . e,   e = error of d.
// The ramp takes up shading, which moves with the light and not with the surface. Grey values are
// taken relative to the patch's mean, so that single precision is enough for the sums.
using TermsMatrix = Eigen::Matrix<double, kTerms, kTerms>;
using TermsVector = Eigen::Matrix<double, kTerms, 1>;

struct PatchModel {
  PatchTerms terms;
  int radius = 0, count = 0;  // count: floats of a term that are used, with the padding
  float mean = 0.0f;          // grey
  double support = 0.0;       // pixels that count
  TermsMatrix inverse;        // of the normal matrix
  bool striped = false;       // matched along `across` only, which the first term stands for
  Eigen::Vector2d across = Eigen::Vector2d::Zero();

  // The displacement that the two gradient terms' coefficients mean.
  Eigen::Vector2d direction(const Eigen::Vector2d& coefficients) const {
    return striped ? Eigen::Vector2d(coefficients.x() * across) : coefficients;
  }
};

// Samples the square around a position of the picture, row by row; every pixel has the same
// bilinear weights. False when the square does not fit.
bool sampleSquare(const ImageWindow& window, const Eigen::Vector2d& at, int radius, float* out) {
  const double x = at.x() - window.origin.x - radius, y = at.y() - window.origin.y - radius;
  const int side = 2 * radius + 1;
  if (!(x >= 0.0 && y >= 0.0 && x < window.image.cols - side && y < window.image.rows - side)) {
    return false;
  }
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  sampleRows(window.image.ptr<float>(y0) + x0, static_cast<long>(window.image.step1()),
             static_cast<float>(x - x0), static_cast<float>(y - y0), side, out);
  return true;
}

// Gradient energy in the picture's directions that is left after gain, offset and ramp are taken
// out. Nothing when the patch is flat.
std::optional<Eigen::Matrix2d> gradientEnergy(const TermsMatrix& inverse) {
  const Eigen::Matrix2d covariance = inverse.topLeftCorner<2, 2>();
  if (!covariance.allFinite() || covariance.determinant() <= 0.0) return std::nullopt;
  return covariance.inverse();
}

void factorise(PatchModel& model) {
  float sums[kTerms][kTerms];
  multiplyTerms(model.terms, model.count, sums);
  TermsMatrix normal =
      Eigen::Map<Eigen::Matrix<float, kTerms, kTerms, Eigen::RowMajor>>(&sums[0][0]).cast<double>();
  if (model.striped) normal(kGradientY, kGradientY) = 1.0;
  model.inverse = Eigen::LDLT<TermsMatrix>(normal).solve(TermsMatrix::Identity());
}

// Leaves only motion along `across` free.
void restrictTo(const Eigen::Vector2d& across, PatchModel& model) {
  float *x = model.terms.at[kGradientX], *y = model.terms.at[kGradientY];
  for (int p = 0; p < model.count; ++p) {
    x[p] = static_cast<float>(across.x() * x[p] + across.y() * y[p]);
    y[p] = 0.0f;
  }
  model.striped = true;
  model.across = across;
  factorise(model);
}

// False where the patch leaves a picture, or has too little support or texture.
bool buildModel(const PatchSource& source, const PatchParams& params, PatchModel& model) {
  alignas(64) float values[kWidePatch], weights[kWidePatch];
  if (!sampleSquare(source.gray, source.at, params.radius_px + 1, values)) return false;
  if (!sampleSquare(source.weight, source.weight_at, params.radius_px + 1, weights)) return false;
  model.radius = params.radius_px;
  const int pixels = (2 * model.radius + 1) * (2 * model.radius + 1);
  model.count = (pixels + 15) / 16 * 16;
  const PatchFill fill = fillTerms(values, weights, model.radius, model.count, model.terms);
  model.support = fill.support;
  if (model.support < std::max(1.0, params.least_support * pixels)) return false;
  model.mean = fill.sum / fill.support;
  factorise(model);
  const std::optional<Eigen::Matrix2d> energy = gradientEnergy(model.inverse);
  if (!energy) return false;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> directions(*energy);
  const double least = params.least_gradient * params.least_gradient * model.support;
  if (directions.eigenvalues()[0] > least) return true;
  if (!params.stripes || directions.eigenvalues()[1] <= least) return false;
  restrictTo(directions.eigenvectors().col(1), model);
  return true;
}

struct Regression {
  TermsVector coefficients;  // (-gain e_x, -gain e_y, gain, offset, ramp)
  double squared_residual;
  double squared_signal;  // sum of squares of the target about its mean
};

// @param target  the target's grey values
Regression regress(const PatchModel& model, const float* target) {
  float sums[kTerms + 1];
  multiplyTarget(model.terms, model.count, model.mean, target, sums);
  const TermsVector right = Eigen::Map<Eigen::Matrix<float, kTerms, 1>>(sums).cast<double>();
  const double squared = sums[kTerms];
  Regression result;
  result.coefficients = model.inverse * right;
  result.squared_signal = squared - right[kOne] * right[kOne] / model.support;
  result.squared_residual = std::max(0.0, squared - result.coefficients.dot(right));
  return result;
}

PatchMatch makeMatch(const PatchModel& model, const Regression& fit,
                     const Eigen::Vector2d& position) {
  const double gain = fit.coefficients[kValue];
  const double noise = fit.squared_residual / std::max(1.0, model.support - kTerms);
  PatchMatch match;
  match.position = position;
  match.covariance = model.inverse.topLeftCorner<2, 2>() * noise / (gain * gain);
  match.deviation =
      std::sqrt(model.striped ? match.covariance(0, 0) : 0.5 * match.covariance.trace());
  if (model.striped) {
    const Eigen::Vector2d along(-model.across.y(), model.across.x());
    match.covariance = match.covariance(0, 0) * model.across * model.across.transpose() +
                       kAlongPx * kAlongPx * along * along.transpose();
  }
  match.correlation =
      std::sqrt(std::max(0.0, 1.0 - fit.squared_residual / std::max(1e-9, fit.squared_signal)));
  return match;
}

}  // namespace

std::optional<PatchMatch> matchPatch(const PatchSource& source, const ImageWindow& target,
                                     const Eigen::Vector2d& start, const PatchParams& params) {
  if (params.radius_px < 1 || params.radius_px > kMostRadius) {
    throw std::invalid_argument("patch radius is " + std::to_string(params.radius_px) +
                                " px; give 1 to " + std::to_string(kMostRadius));
  }
  PatchModel model;
  if (!buildModel(source, params, model)) return std::nullopt;
  alignas(64) float sampled[kPatchStride] = {};
  Eigen::Vector2d position = start;
  for (int iteration = 0; iteration < params.max_iterations; ++iteration) {
    if (!sampleSquare(target, position, params.radius_px, sampled)) return std::nullopt;
    const Regression fit = regress(model, sampled);
    const double gain = fit.coefficients[kValue];
    if (gain < kLeastGain) return std::nullopt;
    const Eigen::Vector2d step = -model.direction(fit.coefficients.head<2>()) / gain;
    if (!(step.norm() < params.radius_px)) return std::nullopt;
    position += step;
    if (step.norm() < params.converged_px) return makeMatch(model, fit, position);
  }
  return std::nullopt;
}

}  // namespace calipso::flow

#include "calipso_flow/patch_match.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

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
enum Term { kGradientX, kGradientY, kValue, kOne, kRampX, kRampY, kTerms };
using TermsMatrix = Eigen::Matrix<double, kTerms, kTerms>;
using TermsVector = Eigen::Matrix<double, kTerms, 1>;
using Values = std::vector<float>;

struct PatchModel {
  std::array<Values, kTerms> terms;  // per pixel; 0 where the pixel does not count
  float mean = 0.0f;                 // grey
  double support = 0.0;              // pixels that count
  Eigen::LDLT<TermsMatrix> factor;
  TermsMatrix inverse;
  bool striped = false;          // matched along `across` only, which the first term stands for
  Eigen::Vector2d across = Eigen::Vector2d::Zero();

  // The displacement that the two gradient terms' coefficients mean.
  Eigen::Vector2d direction(const Eigen::Vector2d& coefficients) const {
    return striped ? Eigen::Vector2d(coefficients.x() * across) : coefficients;
  }
};

double dot(const Values& a, const Values& b) {
  float sum = 0.0f;
  const int count = static_cast<int>(a.size());
#pragma omp simd reduction(+ : sum)
  for (int k = 0; k < count; ++k) sum += a[k] * b[k];
  return sum;
}

// Samples the square around a position of the picture, row by row; every pixel has the same
// bilinear weights. False when the square does not fit.
bool sampleSquare(const ImageWindow& window, const Eigen::Vector2d& at, int radius, Values& out) {
  const double x = at.x() - window.origin.x - radius, y = at.y() - window.origin.y - radius;
  const int side = 2 * radius + 1;
  if (!(x >= 0.0 && y >= 0.0 && x < window.image.cols - side && y < window.image.rows - side)) {
    return false;
  }
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const float fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
  const float w00 = (1 - fx) * (1 - fy), w01 = fx * (1 - fy), w10 = (1 - fx) * fy, w11 = fx * fy;
  out.resize(side * side);
  for (int j = 0; j < side; ++j) {
    const float* top = window.image.ptr<float>(y0 + j) + x0;
    const float* bottom = window.image.ptr<float>(y0 + j + 1) + x0;
    float* row = out.data() + j * side;
#pragma omp simd
    for (int i = 0; i < side; ++i) {
      row[i] = w00 * top[i] + w01 * top[i + 1] + w10 * bottom[i] + w11 * bottom[i + 1];
    }
  }
  return true;
}

// Gradient energy in the picture's directions that is left after gain, offset and ramp are taken out.
// Nothing when the patch is flat.
std::optional<Eigen::Matrix2d> gradientEnergy(const TermsMatrix& inverse) {
  const Eigen::Matrix2d covariance = inverse.topLeftCorner<2, 2>();
  if (!covariance.allFinite() || covariance.determinant() <= 0.0) return std::nullopt;
  return covariance.inverse();
}

// Fills the terms from grey values and weights that have one more ring than the patch, for central
// differences; a pixel counts when it and its four neighbours do.
void fillTerms(const Values& values, const Values& weights, int radius, PatchModel& model) {
  const int side = 2 * radius + 1, wide = side + 2;
  for (Values& term : model.terms) term.assign(side * side, 0.0f);
  double sum = 0.0;
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      const int k = (j + 1) * wide + i + 1, p = j * side + i;
      const float least = std::min({weights[k], weights[k - 1], weights[k + 1], weights[k - wide],
                                    weights[k + wide]});
      if (least < 0.99f) continue;
      model.terms[kGradientX][p] = 0.5f * (values[k + 1] - values[k - 1]);
      model.terms[kGradientY][p] = 0.5f * (values[k + wide] - values[k - wide]);
      model.terms[kValue][p] = values[k];
      model.terms[kOne][p] = 1.0f;
      model.terms[kRampX][p] = static_cast<float>(i - radius);
      model.terms[kRampY][p] = static_cast<float>(j - radius);
      model.support += 1.0;
      sum += values[k];
    }
  }
  if (model.support == 0.0) return;
  model.mean = static_cast<float>(sum / model.support);
  for (size_t p = 0; p < model.terms[kOne].size(); ++p) {
    model.terms[kValue][p] -= model.mean * model.terms[kOne][p];
  }
}

void factorise(PatchModel& model) {
  TermsMatrix normal;
  for (int a = 0; a < kTerms; ++a) {
    for (int b = 0; b <= a; ++b) {
      normal(a, b) = normal(b, a) = dot(model.terms[a], model.terms[b]);
    }
  }
  if (model.striped) normal(kGradientY, kGradientY) = 1.0;
  model.factor.compute(normal);
  model.inverse = model.factor.solve(TermsMatrix::Identity());
}

// Leaves only motion along `across` free.
void restrictTo(const Eigen::Vector2d& across, PatchModel& model) {
  Values &x = model.terms[kGradientX], &y = model.terms[kGradientY];
  for (size_t p = 0; p < x.size(); ++p) {
    x[p] = static_cast<float>(across.x() * x[p] + across.y() * y[p]);
    y[p] = 0.0f;
  }
  model.striped = true;
  model.across = across;
  factorise(model);
}

std::optional<PatchModel> buildModel(const PatchSource& source, const PatchParams& params) {
  Values values, weights;
  if (!sampleSquare(source.gray, source.at, params.radius_px + 1, values)) return std::nullopt;
  if (!sampleSquare(source.weight, source.weight_at, params.radius_px + 1, weights)) {
    return std::nullopt;
  }
  PatchModel model;
  fillTerms(values, weights, params.radius_px, model);
  const double pixels = static_cast<double>(model.terms[kOne].size());
  if (model.support < params.least_support * pixels) return std::nullopt;
  factorise(model);
  const std::optional<Eigen::Matrix2d> energy = gradientEnergy(model.inverse);
  if (!energy) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> directions(*energy);
  const double least = params.least_gradient * params.least_gradient * model.support;
  if (directions.eigenvalues()[0] > least) return model;
  if (!params.stripes || directions.eigenvalues()[1] <= least) return std::nullopt;
  restrictTo(directions.eigenvectors().col(1), model);
  return model;
}

struct Regression {
  TermsVector coefficients;  // (-gain e_x, -gain e_y, gain, offset, ramp)
  double squared_residual;
  double squared_signal;  // sum of squares of the target about its mean
};

// @param target  the target's grey values; changed: made relative to the patch's mean
Regression regress(const PatchModel& model, Values& target) {
  const Values& one = model.terms[kOne];
  for (size_t p = 0; p < target.size(); ++p) target[p] = (target[p] - model.mean) * one[p];
  TermsVector right;
  for (int a = 0; a < kTerms; ++a) right[a] = dot(model.terms[a], target);
  const double squared = dot(target, target);
  Regression result;
  result.coefficients = model.factor.solve(right);
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
  if (model.striped) {
    const Eigen::Vector2d along(-model.across.y(), model.across.x());
    match.covariance = match.covariance(0, 0) * model.across * model.across.transpose() +
                       kAlongPx * kAlongPx * along * along.transpose();
  }
  match.correlation = std::sqrt(
      std::max(0.0, 1.0 - fit.squared_residual / std::max(1e-9, fit.squared_signal)));
  return match;
}

}  // namespace

std::optional<PatchMatch> matchPatch(const PatchSource& source, const ImageWindow& target,
                                     const Eigen::Vector2d& start, const PatchParams& params) {
  const std::optional<PatchModel> model = buildModel(source, params);
  if (!model) return std::nullopt;
  Values sampled;
  Eigen::Vector2d position = start;
  for (int iteration = 0; iteration < params.max_iterations; ++iteration) {
    if (!sampleSquare(target, position, params.radius_px, sampled)) return std::nullopt;
    const Regression fit = regress(*model, sampled);
    const double gain = fit.coefficients[kValue];
    if (gain < kLeastGain) return std::nullopt;
    const Eigen::Vector2d step = -model->direction(fit.coefficients.head<2>()) / gain;
    if (!(step.norm() < params.radius_px)) return std::nullopt;
    position += step;
    if (step.norm() < params.converged_px) return makeMatch(*model, fit, position);
  }
  return std::nullopt;
}

}  // namespace calipso::flow

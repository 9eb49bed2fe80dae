#include "calipso_flow/patch_match.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

namespace calipso::flow {
namespace {

// A patch whose weaker gradient direction varies by less than this, in grey levels per pixel, gives
// no reliable position.
constexpr double kLeastGradient = 0.4;

// A match whose contrast is a smaller share of the patch's shows another surface.
constexpr double kLeastGain = 0.2;

float bilinear(const cv::Mat& image, double x, double y) {
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const float fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
  const float* top = image.ptr<float>(y0) + x0;
  const float* bottom = image.ptr<float>(y0 + 1) + x0;
  return (1 - fy) * ((1 - fx) * top[0] + fx * top[1]) +
         fy * ((1 - fx) * bottom[0] + fx * bottom[1]);
}

// True when the square around (x, y) of the image can be sampled.
bool fits(const cv::Mat& image, double x, double y, int radius) {
  return x >= radius && y >= radius && x < image.cols - 1 - radius && y < image.rows - 1 - radius;
}

// Samples the square around a position of the picture, row by row. False when it does not fit.
bool sampleSquare(const ImageWindow& window, const Eigen::Vector2d& at, int radius,
                  std::vector<float>& out) {
  const double x = at.x() - window.origin.x, y = at.y() - window.origin.y;
  if (!fits(window.image, x, y, radius)) return false;
  out.clear();
  for (int j = -radius; j <= radius; ++j) {
    for (int i = -radius; i <= radius; ++i) out.push_back(bilinear(window.image, x + i, y + j));
  }
  return true;
}

// The patch as a linear model of what the target shows near the right place:
//   I(x + d) = gain T(x) + offset + ramp . x - gain grad T(x) . e,   e = error of d.
// The ramp takes up shading, which moves with the light and not with the surface.
constexpr int kTerms = 6;
using TermsMatrix = Eigen::Matrix<double, kTerms, kTerms>;
using TermsVector = Eigen::Matrix<double, kTerms, 1>;
using TermsRow = Eigen::Matrix<float, kTerms, 1>;

struct PatchModel {
  std::vector<TermsRow> rows;  // (T_x, T_y, T, 1, x, y) per pixel
  std::vector<float> weights;
  Eigen::LDLT<TermsMatrix> factor;
  TermsMatrix inverse;
  double support = 0.0;  // sum of weights
};

// True when enough gradient is left in every direction after gain, offset and ramp are taken out.
bool hasTexture(const TermsMatrix& inverse, double support) {
  const Eigen::Matrix2d covariance = inverse.topLeftCorner<2, 2>();
  if (!covariance.allFinite() || covariance.determinant() <= 0.0) return false;
  const Eigen::Matrix2d energy = covariance.inverse();
  const double half_trace = 0.5 * energy.trace();
  const double spread = std::sqrt(std::max(0.0, half_trace * half_trace - energy.determinant()));
  return half_trace - spread > kLeastGradient * kLeastGradient * support;
}

std::optional<PatchModel> buildModel(const PatchSource& source, const PatchParams& params) {
  const int r = params.radius_px, wide = 2 * r + 3;
  // One more ring than the patch, for central differences.
  std::vector<float> values, weights;
  if (!sampleSquare(source.gray, source.at, r + 1, values)) return std::nullopt;
  if (!sampleSquare(source.weight, source.weight_at, r + 1, weights)) return std::nullopt;

  PatchModel model;
  TermsMatrix normal = TermsMatrix::Zero();
  for (int j = 1; j <= 2 * r + 1; ++j) {
    for (int i = 1; i <= 2 * r + 1; ++i) {
      const int k = j * wide + i;
      const float around = std::min(std::min(weights[k - 1], weights[k + 1]),
                                    std::min(weights[k - wide], weights[k + wide]));
      const float w = std::min(weights[k], around) > 0.99f ? 1.0f : 0.0f;
      TermsRow row;
      row << 0.5f * (values[k + 1] - values[k - 1]), 0.5f * (values[k + wide] - values[k - wide]),
          values[k], 1.0f, i - 1.0f - r, j - 1.0f - r;
      model.rows.push_back(row);
      model.weights.push_back(w);
      if (w == 0.0f) continue;
      normal += row.cast<double>() * row.cast<double>().transpose();
      model.support += w;
    }
  }
  const double pixels = (2 * r + 1) * (2 * r + 1);
  if (model.support < params.least_support * pixels) return std::nullopt;
  model.factor.compute(normal);
  model.inverse = model.factor.solve(TermsMatrix::Identity());
  if (!hasTexture(model.inverse, model.support)) return std::nullopt;
  return model;
}

struct Regression {
  TermsVector coefficients;  // (-gain e_x, -gain e_y, gain, offset, ramp)
  double squared_residual;
  double squared_signal;  // sum of squares of the target about its weighted mean
};

Regression regress(const PatchModel& model, const std::vector<float>& target) {
  TermsVector right = TermsVector::Zero();
  double sum = 0.0, sum_squared = 0.0;
  for (size_t k = 0; k < target.size(); ++k) {
    const double value = model.weights[k] * target[k];
    right += value * model.rows[k].cast<double>();
    sum += value;
    sum_squared += value * target[k];
  }
  Regression result;
  result.coefficients = model.factor.solve(right);
  result.squared_signal = sum_squared - sum * sum / model.support;
  result.squared_residual = std::max(0.0, sum_squared - result.coefficients.dot(right));
  return result;
}

PatchMatch makeMatch(const PatchModel& model, const Regression& fit,
                     const Eigen::Vector2d& position) {
  const double gain = fit.coefficients[2];
  const double noise = fit.squared_residual / std::max(1.0, model.support - kTerms);
  PatchMatch match;
  match.position = position;
  match.covariance = model.inverse.topLeftCorner<2, 2>() * noise / (gain * gain);
  match.correlation = std::sqrt(
      std::max(0.0, 1.0 - fit.squared_residual / std::max(1e-9, fit.squared_signal)));
  return match;
}

}  // namespace

std::optional<PatchMatch> matchPatch(const PatchSource& source, const ImageWindow& target,
                                     const Eigen::Vector2d& start, const PatchParams& params) {
  const std::optional<PatchModel> model = buildModel(source, params);
  if (!model) return std::nullopt;
  std::vector<float> sampled;
  Eigen::Vector2d position = start;
  for (int iteration = 0; iteration < params.max_iterations; ++iteration) {
    if (!sampleSquare(target, position, params.radius_px, sampled)) return std::nullopt;
    const Regression fit = regress(*model, sampled);
    const double gain = fit.coefficients[2];
    if (gain < kLeastGain) return std::nullopt;
    const Eigen::Vector2d step = -fit.coefficients.head<2>() / gain;
    if (!(step.norm() < params.radius_px)) return std::nullopt;
    position += step;
    if (step.norm() < params.converged_px) return makeMatch(*model, fit, position);
  }
  return std::nullopt;
}

}  // namespace calipso::flow

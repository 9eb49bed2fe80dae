#include "calipso_align/low_order_stage.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "calipso_align/rigid_part.hpp"

namespace calipso::align {
namespace {

using Map = LowOrderMap;
using Hessian = Eigen::Matrix<double, Map::kParameters, Map::kParameters>;

double informationOf(double deviation) {
  return deviation > 0.0 ? 1.0 / (deviation * deviation) : std::numeric_limits<double>::infinity();
}

// s_i of a coefficient of the deformation: what it deviates by, in units of a.
double relativeDeviation(int i) {
  const bool is_square = (i - (i < Map::kQuadratic ? Map::kStrain : Map::kQuadratic)) % 6 < 3;
  if (i < Map::kQuadratic) return is_square ? 1.0 : std::sqrt(0.5);
  return kOrderRatio * (is_square ? std::sqrt(0.75) : 1.0);
}

struct NormalEquations {
  Hessian H = Hessian::Zero();
  Map::Parameters gradient = Map::Parameters::Zero();
};

// Of the first `count` parameters: all others are held.
NormalEquations assemble(const Points& X, const Rows& rows, const Map& map, int count) {
  // J' W J of many rows at a time is one product of matrices.
  constexpr int kPanel = 256;
  Eigen::MatrixXd panel(count, kPanel);
  NormalEquations normal;
  int filled = 0;
  const auto flush = [&] {
    normal.H.topLeftCorner(count, count)
        .selfadjointView<Eigen::Lower>()
        .rankUpdate(panel.leftCols(filled));
    filled = 0;
  };
  for (const PointRow& row : rows) {
    if (row.weight == 0.0) continue;
    Map::Parameters j = Map::Parameters::Zero();
    for (int k = 0; k < 3; ++k)
      if (row.a[k] != 0.0) j += map.gradient(X.row(row.v[k]), row.a[k] * row.g);
    panel.col(filled++) = std::sqrt(row.weight) * j.head(count);
    normal.gradient += row.weight * row.r * j;
    if (filled == kPanel) flush();
  }
  flush();
  normal.H = Hessian(normal.H.selfadjointView<Eigen::Lower>());
  return normal;
}

// How many parameters there are up to the last that is not held.
int leadingFree(const Map::Parameters& info) {
  int count = Map::kParameters;
  while (count > 0 && std::isinf(info[count - 1])) --count;
  return count;
}

// A measurement of one number of weight w, whose derivative is j and which is off by r.
void addRow(const Eigen::Matrix<double, 1, Map::kParameters>& j, double r, double w,
            NormalEquations& normal) {
  if (w == 0.0 || std::isinf(w)) return;
  normal.H += w * j.transpose() * j;
  normal.gradient += w * r * j.transpose();
}

// The rough placement measures the rigid part of the map.
void addPlacement(const Points& X, const LowOrderPrior& prior, const Map& map,
                  NormalEquations& normal) {
  const RigidPart rigid = rigidPart(X, map);
  const Eigen::Vector3d deviation(prior.in_plane, prior.in_plane, prior.depth);
  for (int k = 0; k < 3; ++k) {
    addRow(rigid.rotation_by_parameters.row(k), rigid.rotation[k],
           informationOf(prior.rotation_rad), normal);
    addRow(rigid.translation_by_parameters.row(k), rigid.translation[k],
           informationOf(deviation[k] * map.size()), normal);
  }
}

// Adds the deformation's prior, and replaces held parameters by a unit row.
void addPrior(const Map::Parameters& info, const Map::Parameters& off, NormalEquations& normal) {
  for (int i = 0; i < Map::kParameters; ++i) {
    if (std::isinf(info[i])) {
      normal.H.row(i).setZero();
      normal.H.col(i).setZero();
      normal.H(i, i) = 1.0;
      normal.gradient[i] = 0.0;
    } else {
      normal.H(i, i) += info[i];
      normal.gradient[i] += info[i] * off[i];
    }
  }
}

// a from the coefficients' deviations p and their covariance C, given the a that led to them.
double estimateDeformation(const Map::Parameters& p, const Hessian& C, const Map::Parameters& info,
                           double a) {
  constexpr double kLeast = 0.002, kLargest = 0.8, kLargestChange = 2.0;
  double sum = 0.0, gamma = 0.0;
  for (int i = Map::kStrain; i < Map::kParameters; ++i) {
    if (std::isinf(info[i])) continue;
    const double s = relativeDeviation(i);
    sum += p[i] * p[i] / (s * s);
    gamma += std::max(0.0, 1.0 - C(i, i) * info[i]);
  }
  if (!(gamma > 0.0)) return a;
  const double count = std::max(gamma - 2.0, gamma / 3.0);
  const double estimate =
      std::clamp(std::sqrt(sum / count), a / kLargestChange, a * kLargestChange);
  return std::clamp(estimate, kLeast, kLargest);
}

}  // namespace

Map::Parameters information(const LowOrderPrior& prior) {
  Map::Parameters info;
  const auto heldIf = [](bool held) {
    return held ? std::numeric_limits<double>::infinity() : 0.0;
  };
  const double a = prior.deformation;
  info.segment<3>(Map::kRotation).setConstant(heldIf(prior.rotation_rad == 0.0));
  info.segment<2>(Map::kTranslation).setConstant(heldIf(prior.in_plane == 0.0));
  info[Map::kTranslation + 2] = heldIf(prior.depth == 0.0);
  info[Map::kLogScale] = informationOf(prior.log_scale);
  for (int i = Map::kStrain; i < Map::kParameters; ++i) {
    const bool is_held = i >= Map::kQuadratic && !prior.quadratic;
    info[i] = informationOf(is_held ? 0.0 : a * relativeDeviation(i));
  }
  return info;
}

LowOrderReport fitLowOrder(const Points& X, const Observe& observe,
                           const LowOrderStageOptions& options, Map& map) {
  LowOrderPrior prior = options.prior;
  LowOrderReport report;
  for (; report.iterations < options.iterations && !report.converged; ++report.iterations) {
    const Map::Parameters info = information(prior);
    NormalEquations normal = assemble(
        X, observe(map.apply(X), report.iterations, prior.deformation), map, leadingFree(info));
    addPlacement(X, prior, map, normal);
    addPrior(info, map.parameters(), normal);
    const Eigen::LDLT<Hessian> factor(normal.H);
    const Map::Parameters step = -factor.solve(normal.gradient);
    if (!step.allFinite()) break;

    // A step that turns or scales by more than this leaves what the linearisation describes.
    constexpr double kLongestStep = 0.35;
    Map::Parameters scaled = step;
    scaled.segment<3>(Map::kTranslation) /= map.size();
    const double length = scaled.lpNorm<Eigen::Infinity>();
    map.setParameters(map.plus(step * std::min(1.0, kLongestStep / std::max(length, 1e-300))));
    report.converged = length < options.smallest_step;
    if (options.estimate_deformation) {
      const double before = prior.deformation;
      prior.deformation =
          estimateDeformation(map.parameters(), factor.solve(Hessian::Identity()), info, before);
      constexpr double kSettled = 0.05;
      report.converged &= std::abs(prior.deformation - before) < kSettled * before;
    }
  }
  report.deformation = prior.deformation;
  return report;
}

Eigen::MatrixXd covariance(const Points& X, const Rows& rows, const LowOrderPrior& prior,
                           const Map& map) {
  const Map::Parameters info = information(prior);
  NormalEquations normal = assemble(X, rows, map, leadingFree(info));
  addPlacement(X, prior, map, normal);
  addPrior(info, map.parameters(), normal);
  Eigen::MatrixXd inverse = normal.H.ldlt().solve(Hessian::Identity());
  for (int i = 0; i < Map::kParameters; ++i) {
    if (!std::isinf(info[i])) continue;
    inverse.row(i).setZero();
    inverse.col(i).setZero();
  }
  return inverse;
}

}  // namespace calipso::align

#include "calipso_align/low_order_stage.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace calipso::align {
namespace {

using Map = LowOrderMap;
using Hessian = Eigen::Matrix<double, Map::kParameters, Map::kParameters>;

double informationOf(double deviation) {
  return deviation > 0.0 ? 1.0 / (deviation * deviation)
                         : std::numeric_limits<double>::infinity();
}

struct NormalEquations {
  Hessian H = Hessian::Zero();
  Map::Parameters gradient = Map::Parameters::Zero();
};

NormalEquations assemble(const Points& X, const Rows& rows, const Map& map) {
  NormalEquations normal;
  for (const PointRow& row : rows) {
    if (row.weight == 0.0) continue;
    const Map::Parameters j = row.a0 * map.jacobian(X.row(row.v0)).transpose() * row.g +
                              row.a1 * map.jacobian(X.row(row.v1)).transpose() * row.g;
    normal.H.selfadjointView<Eigen::Lower>().rankUpdate(j, row.weight);
    normal.gradient += row.weight * row.r * j;
  }
  normal.H = Hessian(normal.H.selfadjointView<Eigen::Lower>());
  return normal;
}

// Adds the prior, and replaces held parameters by a unit row.
void addPrior(const Map::Parameters& info, const Map::Parameters& p, NormalEquations& normal) {
  for (int i = 0; i < Map::kParameters; ++i) {
    if (std::isinf(info[i])) {
      normal.H.row(i).setZero();
      normal.H.col(i).setZero();
      normal.H(i, i) = 1.0;
      normal.gradient[i] = 0.0;
    } else {
      normal.H(i, i) += info[i];
      normal.gradient[i] += info[i] * p[i];
    }
  }
}

}  // namespace

Map::Parameters information(const LowOrderPrior& prior, const Map& map) {
  Map::Parameters info;
  info.segment<3>(Map::kRotation).setConstant(informationOf(prior.rotation_rad));
  info.segment<2>(Map::kTranslation).setConstant(informationOf(prior.in_plane * map.size()));
  info[Map::kTranslation + 2] = informationOf(prior.depth * map.size());
  info[Map::kLogScale] = informationOf(prior.log_scale);
  for (int k = 0; k < 6; ++k) {
    const bool in_plane = k == 0 || k == 1 || k == 3;
    const double deviation = in_plane ? prior.strain : k == 2 ? prior.strain_depth : prior.shear;
    info[Map::kStrain + k] = informationOf(deviation);
  }
  info.segment<12>(Map::kQuadratic).setConstant(informationOf(prior.quadratic));
  info.segment<6>(Map::kQuadratic + 12).setConstant(informationOf(prior.quadratic_depth));
  return info;
}

LowOrderReport fitLowOrder(const Points& X, const Observe& observe,
                           const LowOrderStageOptions& options, Map& map) {
  const Map::Parameters info = information(options.prior, map);
  LowOrderReport report;
  for (; report.iterations < options.iterations && !report.converged; ++report.iterations) {
    NormalEquations normal = assemble(X, observe(map.apply(X), report.iterations), map);
    addPrior(info, map.parameters(), normal);
    const Map::Parameters step = -normal.H.ldlt().solve(normal.gradient);
    if (!step.allFinite()) break;

    // A step that turns or scales by more than this leaves what the linearisation describes.
    constexpr double kLongestStep = 0.35;
    Map::Parameters scaled = step;
    scaled.segment<3>(Map::kTranslation) /= map.size();
    const double length = scaled.lpNorm<Eigen::Infinity>();
    map.setParameters(map.plus(step * std::min(1.0, kLongestStep / std::max(length, 1e-300))));
    report.converged = length < options.smallest_step;
  }
  return report;
}

Eigen::MatrixXd covariance(const Points& X, const Rows& rows, const LowOrderPrior& prior,
                           const Map& map) {
  const Map::Parameters info = information(prior, map);
  NormalEquations normal = assemble(X, rows, map);
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

#include "calipso_align/contour_term.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "outline_search.hpp"

namespace calipso::align {
namespace {

// For every query, the nearest candidate that is close enough and looks the same way; -1 for none.
std::vector<int> nearest(const std::vector<Feature>& queries,
                         const std::vector<Feature>& candidates,
                         const ContourTermOptions& options) {
  const float scale = static_cast<float>(options.normal_scale_px);
  // n.n >= cosine  <=>  |s n - s n'|^2 <= 2 s^2 (1 - cosine); without scale normals do not count.
  const float reject_turn =
      scale > 0.0f ? 2.0f * scale * scale * (1.0f - static_cast<float>(options.reject_cosine))
                   : std::numeric_limits<float>::max();
  const OutlineSearch search(candidates, static_cast<float>(options.reject_px), reject_turn);
  std::vector<int> match(queries.size());
#pragma omp parallel for schedule(static)
  for (size_t q = 0; q < queries.size(); ++q) match[q] = search.nearest(queries[q]);
  return match;
}

std::vector<Feature> featuresOf(const ContourTarget& target, double scale) {
  std::vector<Feature> features;
  for (const TargetPoint& p : target.points) {
    features.push_back(p.foreign ? kNowhere : featureOf(p.pixel, p.normal, scale));
  }
  return features;
}

std::vector<Feature> featuresOf(const std::vector<OutlinePoint>& outline, double scale) {
  std::vector<Feature> features;
  for (const OutlinePoint& p : outline) features.push_back(featureOf(p.pixel, p.normal, scale));
  return features;
}

// The residual outside of the dead band.
double shrink(double r, double band) {
  return std::abs(r) <= band ? 0.0 : r - std::copysign(band, r);
}

void appendPair(const TargetPoint& data, const OutlinePoint& model, const Camera& camera,
                double weight, const ContourTermOptions& options, Rows& rows) {
  const Eigen::Matrix<double, 2, 3> d = camera.projectJacobian(model.position);
  const Eigen::Vector2d gap = model.pixel - data.pixel;
  const Eigen::Vector2d tangent(-data.normal.y(), data.normal.x());
  const double r = shrink(data.normal.dot(gap), options.dead_band_px);
  const double w = weight * gemanMcClure(r, options.robust_px);
  const std::array<int, 3> v = {model.v0, model.v1, model.v1};
  const std::array<double, 3> a = {model.a0, model.a1, 0.0};
  rows.push_back({v, a, d.transpose() * data.normal, r, w});
  if (options.tangential > 0.0) {
    // What is hidden finds the ends of what is seen: it must not be drawn together there.
    const double along = tangent.dot(gap);
    rows.push_back({v, a, d.transpose() * tangent, along,
                    options.tangential * w * gemanMcClure(along, options.robust_px)});
  }
}

// Points of the outline at equal distances along it, so that neither short edges nor lattices of
// many bars count for more than their length.
std::vector<int> spreadEvenly(const std::vector<OutlinePoint>& outline) {
  constexpr double kFinestPx = 2.0, kMostPoints = 800.0;
  double length = 0.0;
  for (const OutlinePoint& p : outline) length += p.length_px;
  const double spacing = std::max(kFinestPx, length / kMostPoints);
  std::vector<int> chosen;
  double along = 0.5 * spacing;
  for (size_t k = 0; k < outline.size(); ++k) {
    along += outline[k].length_px;
    if (along < spacing) continue;
    along = std::fmod(along, spacing);
    chosen.push_back(static_cast<int>(k));
  }
  return chosen;
}

}  // namespace

std::vector<int> matchTargetToOutline(const ContourTarget& target,
                                      const std::vector<OutlinePoint>& outline,
                                      const ContourTermOptions& options) {
  return nearest(featuresOf(target, options.normal_scale_px),
                 featuresOf(outline, options.normal_scale_px), options);
}

Rows contourRows(const ContourTarget& target, const std::vector<OutlinePoint>& outline,
                 const Camera& camera, const ContourTermOptions& options) {
  const std::vector<Feature> data = featuresOf(target, options.normal_scale_px);
  const std::vector<Feature> model = featuresOf(outline, options.normal_scale_px);
  const double share = options.two_way ? 0.5 : 1.0;
  Rows rows;

  const std::vector<int> model_of = nearest(data, model, options);
  for (size_t k = 0; k < data.size(); ++k) {
    if (model_of[k] < 0 || !target.points[k].known) continue;
    appendPair(target.points[k], outline[model_of[k]], camera, share * target.points[k].weight,
               options, rows);
  }
  if (!options.two_way) return rows;

  // A part of the outline whose nearest target is unknown may be hidden anywhere beyond it, but the
  // object reaches at least as far as it is seen.
  const std::vector<int> chosen = spreadEvenly(outline);
  std::vector<Feature> model_chosen;
  for (const int k : chosen) model_chosen.push_back(model[k]);
  const std::vector<int> data_of = nearest(model_chosen, data, options);
  const double weight = share * target.length_px / std::max<size_t>(1, chosen.size());
  for (size_t i = 0; i < chosen.size(); ++i) {
    if (data_of[i] < 0) continue;
    const OutlinePoint& q = outline[chosen[i]];
    const TargetPoint& p = target.points[data_of[i]];
    if (!p.known && p.normal.dot(q.pixel - p.pixel) > 0.0) continue;
    appendPair(p, q, camera, weight, options, rows);
  }
  return rows;
}

std::vector<double> contourResiduals(const ContourTarget& target,
                                     const std::vector<OutlinePoint>& outline) {
  ContourTermOptions options;
  options.normal_scale_px = 5.0;
  const std::vector<int> match = matchTargetToOutline(target, outline, options);
  std::vector<double> residuals(target.points.size(), std::numeric_limits<double>::quiet_NaN());
  for (size_t k = 0; k < match.size(); ++k) {
    if (match[k] < 0 || !target.points[k].known) continue;
    const TargetPoint& p = target.points[k];
    residuals[k] = p.normal.dot(outline[match[k]].pixel - p.pixel);
  }
  return residuals;
}

}  // namespace calipso::align

#include "calipso_align/schedule.hpp"

#include <algorithm>
#include <cmath>

namespace calipso::align {
namespace {

constexpr double kElasticWeight = 3e3;  // of the finished fit: see FemStageOptions

LowOrderPrior similarityPrior(const FitProblem& problem, const AlignOptions& options) {
  LowOrderPrior prior;
  prior.rotation_rad = options.rotation_sigma_deg * M_PI / 180.0;
  prior.in_plane = 2.0;
  prior.log_scale = problem.depthIsKnown() ? 0.3 : 0.15;
  // One picture does not show the depth: it is held, unless something else does.
  prior.depth = problem.depthIsKnown() ? 0.5 : 0.0;
  return prior;
}

LowOrderPrior affinePrior(const FitProblem& problem, const AlignOptions& options) {
  LowOrderPrior prior = similarityPrior(problem, options);
  prior.strain = 0.25;
  prior.shear = 0.15;
  prior.strain_depth = problem.depth.empty() ? 0.02 : 0.25;
  return prior;
}

LowOrderPrior quadraticPrior(const FitProblem& problem, const AlignOptions& options) {
  LowOrderPrior prior = affinePrior(problem, options);
  prior.quadratic = 0.3;
  prior.quadratic_depth = problem.depth.empty() ? 0.02 : 0.3;
  return prior;
}

LowOrderStageOptions stage(const LowOrderPrior& prior, int iterations) {
  LowOrderStageOptions options;
  options.prior = prior;
  options.iterations = iterations;
  return options;
}

// Eq. 9 as it stands: pairs of nearest points, all of one weight, held to 4 px.
void makeLiteral(MeasureSettings& settings) {
  constexpr double kEverywherePx = 1e4;
  settings.contour.robust_px = settings.contour.reject_px = kEverywherePx;
  settings.contour.reject_cosine = -1.0;
  settings.contour.normal_scale_px = 0.0;
  settings.contour.tangential = 1.0;
  settings.contour.two_way = false;
  settings.contour.dead_band_px = 4.0;
}

LowOrderStep literalRigidStep(const FitProblem& problem, const AlignOptions& options) {
  LowOrderPrior prior = similarityPrior(problem, options);
  prior.log_scale = 0.0;
  return {"rigid", stage(prior, 15), {1.0, 1.0}, 0.04, {0.15, 0.10}, true};
}

ElasticStep literalElasticStep(const AlignOptions& options) {
  ElasticStep step;
  step.fit.nodes = options.levels.empty() ? 600 : options.levels.front();
  step.fit.poissons_ratio = options.poissons_ratio;
  step.fit.linear = true;
  step.fit.elastic_weights.assign(20, options.elastic_weight * kElasticWeight);
  step.literal = true;
  return step;
}

}  // namespace

double Ramp::at(int k, int count) const {
  const double t = count < 2 ? 1.0 : std::min(1.0, static_cast<double>(k) / (count - 1));
  return from * std::pow(to / from, t);
}

std::vector<LowOrderStep> lowOrderSteps(const FitProblem& problem, const AlignOptions& options) {
  if (options.method == Method::kLiteral) return {literalRigidStep(problem, options)};
  return {{"similarity", stage(similarityPrior(problem, options), 12), {0.10, 0.06},
           0.1, {0.15, 0.10}},
          {"affine", stage(affinePrior(problem, options), 10), {0.06, 0.03},
           0.04, {0.10, 0.05}},
          {"quadratic", stage(quadraticPrior(problem, options), 14), {0.04, 0.015},
           0.01, {0.06, 0.03}}};
}

MeasureSettings settingsAt(const LowOrderStep& step, const FitProblem& problem, int iteration) {
  constexpr double kNarrowestPx = 4.0;  // of the robust kernel
  const double noise = problem.target.noise_px;
  MeasureSettings settings;
  settings.contour.robust_px =
      std::max(step.robust.at(iteration, step.fit.iterations) * problem.extent_px,
               kNarrowestPx + 2.0 * noise);
  settings.contour.reject_px = 3.0 * settings.contour.robust_px;
  settings.contour_sigma_px = std::max(step.sigma * problem.extent_px, 0.5 + noise);
  settings.contour_correlation_px = 10.0;
  settings.depth_robust = step.depth_robust.at(iteration, step.fit.iterations);
  // What the stage's model cannot follow is the same in all measurements: none may drag the model
  // out of another's reach.
  settings.depth_sigma = step.sigma;
  settings.depth_samples = problem.target.known_length_px / settings.contour_correlation_px;
  settings.support_sigma = std::max(settings.support_sigma, 0.1 * step.sigma);
  if (step.literal) makeLiteral(settings);
  return settings;
}

std::vector<ElasticStep> elasticSteps(const FitProblem& problem, const AlignOptions& options) {
  if (options.method == Method::kLiteral) return {literalElasticStep(options)};
  std::vector<ElasticStep> steps;
  const double noise = problem.target.noise_px;
  for (size_t level = 0; level < options.levels.size(); ++level) {
    const bool first = level == 0;
    const int iterations = first ? 10 : 4;
    const double end = options.elastic_weight * kElasticWeight;
    const Ramp stiffness{first ? 3e5 : end, end};
    ElasticStep step;
    step.fit.nodes = options.levels[level];
    step.fit.poissons_ratio = options.poissons_ratio;
    step.fit.depth_sigma = problem.depth.empty() ? 0.1 : 1.0;
    for (int k = 0; k < iterations; ++k) {
      step.fit.elastic_weights.push_back(stiffness.at(k, iterations - 2));
    }
    step.robust_px = first ? Ramp{10.0 + noise, 4.0 + noise} : Ramp{4.0 + noise, 4.0 + noise};
    // Eq. 9 asks for 4 px; once the model is there, the contour's own noise is what remains.
    step.dead_band_px = first ? Ramp{1.0, 0.05} : Ramp{0.05, 0.05};
    steps.push_back(step);
  }
  return steps;
}

MeasureSettings settingsAt(const ElasticStep& step, const FitProblem& problem, int iteration) {
  const int iterations = static_cast<int>(step.fit.elastic_weights.size());
  MeasureSettings settings;
  settings.contour.robust_px = step.robust_px.at(iteration, iterations);
  settings.contour.reject_px = 4.0 * settings.contour.robust_px;
  settings.contour.dead_band_px = step.dead_band_px.at(iteration, iterations);
  settings.contour_sigma_px = 0.5 + 0.2 * problem.target.noise_px;
  settings.contour_correlation_px = 5.0;
  settings.depth_robust = 0.02;
  if (step.literal) makeLiteral(settings);
  return settings;
}

}  // namespace calipso::align

#include "calipso_align/schedule.hpp"

#include <algorithm>
#include <cmath>

namespace calipso::align {
namespace {

constexpr double kElasticWeight = 3e3;  // of the finished fit: see FemStageOptions

// of the model's size: closer than this a stage need not come that another one follows
constexpr double kPassingStep = 2e-3;

constexpr double kTypicalDeformation = 0.15;  // a (LowOrderPrior) before anything is known

// A rough placement is up to a twentieth of the distance off, in any direction: of a length between
// none and that, and of its part along the sight line, the mean square is a third each.
double placementDepthSigma(const FitProblem& problem) {
  return kPlacementError / 3.0 * problem.X.col(2).mean() / LowOrderMap(problem.X).size();
}

// The model's size in the picture is made right before anything else; the distance is held
// meanwhile.
LowOrderPrior similarityPrior(const FitProblem& problem, const AlignOptions& options) {
  LowOrderPrior prior;
  prior.rotation_rad = options.rotation_sigma_deg * M_PI / 180.0;
  prior.in_plane = 2.0;
  prior.log_scale = 0.15;
  prior.depth = problem.depthIsKnown() ? placementDepthSigma(problem) : 0.0;
  return prior;
}

// From here on size is part of the deformation: how far the picture shows another size, and how far
// another distance, follows from how well each is known.
LowOrderPrior deformationPrior(const FitProblem& problem, const AlignOptions& options) {
  LowOrderPrior prior = similarityPrior(problem, options);
  prior.log_scale = 0.0;
  prior.depth = placementDepthSigma(problem);
  prior.deformation = kTypicalDeformation;
  return prior;
}

LowOrderStageOptions stage(const LowOrderPrior& prior, int iterations) {
  LowOrderStageOptions options;
  options.prior = prior;
  options.iterations = iterations;
  return options;
}

LowOrderStep deformationStep(const FitProblem& problem, const AlignOptions& options, int order) {
  LowOrderPrior prior = deformationPrior(problem, options);
  prior.quadratic = order == 2;
  LowOrderStep step;
  step.name = order == 1 ? "affine" : "quadratic";
  step.fit = stage(prior, order == 1 ? 10 : 20);
  if (order == 1) step.fit.smallest_step = kPassingStep;
  step.fit.estimate_deformation = true;
  step.robust = order == 1 ? Ramp{0.06, 0.03} : Ramp{0.04, 0.015};
  step.depth_robust = order == 1 ? Ramp{0.10, 0.05} : Ramp{0.06, 0.03};
  step.order = order;
  return step;
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
  LowOrderStep step;
  step.name = "rigid";
  step.fit = stage(prior, 15);
  step.literal = true;
  return step;
}

ElasticStep literalElasticStep(const AlignOptions& options) {
  // of 3e1 .. 3e4 what met the contours best; softer bodies break
  constexpr double kFixedWeight = 3e4;
  ElasticStep step;
  step.fit.nodes = options.levels.empty() ? 600 : options.levels.front();
  step.fit.poissons_ratio = options.poissons_ratio;
  step.fit.linear = true;
  step.fit.elastic_weights.assign(20, options.elastic_weight * kFixedWeight);
  step.literal = true;
  return step;
}

}  // namespace

double Ramp::at(int k, int count) const {
  const double t = count < 2 ? 1.0 : std::min(1.0, static_cast<double>(k) / (count - 1));
  return from * std::pow(to / from, t);
}

PlacementPrior::PlacementPrior(const Eigen::Vector3d& placed, const Eigen::Vector3d& found)
    : placed_(placed) {
  // The centroid of what deforms is not known exactly itself.
  constexpr double kLeastAlong = 1.0 / 3.0, kBroken = 1.25;
  const Eigen::Vector3d sight = found.normalized();
  const double across = (placed - sight * sight.dot(placed)).norm() / found.norm();
  bound_ = across > kBroken * kPlacementError
               ? std::sqrt(2.0) * across
               : std::max(kPlacementError, std::hypot(across, kLeastAlong * kPlacementError));
  // Measured further away: it is about where it was found.
  const double off = (found - placed).norm() / found.norm();
  if (off > bound_) bound_ = off + kLeastAlong * kPlacementError;
}

double PlacementPrior::density(const Eigen::Vector3d& centroid) const {
  constexpr double kGuided = 0.4;  // of the bound
  const double r = (centroid - placed_).norm() / centroid.norm();
  if (r > bound_) return 0.0;
  const double at_least = std::max(r, kGuided * kPlacementError);
  return 1.0 / (at_least * at_least);
}

double unresolved(int order, double deformation) {
  return deformation * std::pow(kOrderRatio, order) / 3.0;
}

std::vector<LowOrderStep> lowOrderSteps(const FitProblem& problem, const AlignOptions& options) {
  if (options.method == Method::kLiteral) return {literalRigidStep(problem, options)};
  LowOrderStep similarity;
  similarity.name = "similarity";
  similarity.fit = stage(similarityPrior(problem, options), 12);
  similarity.fit.smallest_step = kPassingStep;
  return {similarity, deformationStep(problem, options, 1), deformationStep(problem, options, 2)};
}

MeasureSettings settingsAt(const LowOrderStep& step, const FitProblem& problem, int iteration,
                           double deformation) {
  constexpr double kNarrowestPx = 4.0;  // of the robust kernel
  const double noise = problem.target.noise_px;
  MeasureSettings settings;
  settings.contour.robust_px =
      std::max(step.robust.at(iteration, step.fit.iterations) * problem.extent_px,
               kNarrowestPx + 2.0 * noise);
  settings.contour.reject_px = 3.0 * settings.contour.robust_px;

  // What the stage's model cannot follow changes slowly along the contour, the picture's noise
  // quickly.
  const double misfit = unresolved(step.order, step.order == 0 ? kTypicalDeformation : deformation);
  const double misfit_px = misfit * problem.extent_px, noise_px = 0.5 + 0.5 * noise;
  const double misfit_correlation_px = problem.extent_px / 8.0, noise_correlation_px = 10.0;
  const double variance = misfit_px * misfit_px + noise_px * noise_px;
  settings.contour_sigma_px = std::sqrt(variance);
  settings.contour_correlation_px =
      (misfit_px * misfit_px * misfit_correlation_px + noise_px * noise_px * noise_correlation_px) /
      variance;
  // It is the same in all measurements: none may drag the model out of another's reach.
  settings.depth_robust = step.depth_robust.at(iteration, step.fit.iterations);
  settings.depth_sigma = std::max(settings.depth_sigma, misfit);
  settings.depth_samples = problem.target.known_length_px / settings.contour_correlation_px;
  settings.support_sigma = std::max(settings.support_sigma, 0.1 * misfit);
  if (step.literal) makeLiteral(settings);
  return settings;
}

std::vector<ElasticStep> elasticSteps(const FitProblem& problem, const AlignOptions& options) {
  if (options.method == Method::kLiteral) return {literalElasticStep(options)};
  std::vector<ElasticStep> steps;
  const double noise = problem.target.noise_px;
  for (size_t level = 0; level < options.levels.size(); ++level) {
    const bool first = level == 0;
    const int iterations = first ? 6 : 3;
    const double end = options.elastic_weight * kElasticWeight;
    const Ramp stiffness{first ? 3e5 : end, end};
    ElasticStep step;
    step.fit.nodes = options.levels[level];
    step.fit.poissons_ratio = options.poissons_ratio;
    step.fit.hold_depth = problem.depth.empty();
    step.fit.linear = !first || options.levels.size() == 1;
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

ElasticStep farReaching(const ElasticStep& step, const FitProblem& problem) {
  constexpr int kIterations = 8;
  constexpr double kReach = 0.1;      // of the contour's extent
  constexpr double kStiffest = 10.0;  // of the weight that it ends with
  ElasticStep again = step;
  again.robust_px.from = std::max(step.robust_px.from, kReach * problem.extent_px);
  const double end = step.fit.elastic_weights.back();
  const Ramp stiffness{kStiffest * end, end};
  again.fit.elastic_weights.clear();
  for (int k = 0; k < kIterations; ++k)
    again.fit.elastic_weights.push_back(stiffness.at(k, kIterations - 2));
  return again;
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

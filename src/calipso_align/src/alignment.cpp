#include "calipso_align/alignment.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <future>

#include "calipso_align/fit_problem.hpp"
#include "calipso_align/rigid_part.hpp"
#include "calipso_align/rough_fit.hpp"
#include "calipso_align/schedule.hpp"
#include "calipso_align/shape_uncertainty.hpp"
#include "calipso_align/trust.hpp"

namespace calipso::align {
namespace {

// Where points of the object frame stand in the camera frame.
using Placement = std::function<Points(const Points&)>;

class StageClock {
 public:
  explicit StageClock(std::vector<StageTime>& times) : times_(times) {}
  void stop(const std::string& stage) {
    const auto now = std::chrono::steady_clock::now();
    times_.push_back({stage, std::chrono::duration<double, std::milli>(now - last_).count()});
    last_ = now;
  }

 private:
  std::vector<StageTime>& times_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

// Stages A and B: similarity, affine, quadratic.
struct LowOrderFit {
  LowOrderMap map;
  LowOrderStep last;  // with the prior that it ended with
};

LowOrderFit fitLowOrderStages(const FitProblem& problem, const AlignOptions& options,
                              StageClock& clock) {
  LowOrderFit result{LowOrderMap(problem.X), {}};
  placeRoughly(problem, result.map);
  clock.stop("placement");
  double deformation = 0.0;
  for (LowOrderStep step : lowOrderSteps(problem, options)) {
    if (step.order > 0) result.map.absorbScale();
    if (step.order > 1) step.fit.prior.deformation = deformation;
    const auto observe = [&](const Points& x, int k, double a) {
      return measure(problem, x, settingsAt(step, problem, k, a));
    };
    deformation = fitLowOrder(problem.X, observe, step.fit, result.map).deformation;
    step.fit.prior.deformation = deformation;
    result.last = step;
    clock.stop(step.name);
  }
  return result;
}

// The grids only depend on the stock model: they are laid while the first stages run.
using Grids = std::vector<std::shared_future<fem::VoxelGrid>>;

Grids layGrids(const TriangleMesh& cad, const std::vector<ElasticStep>& steps) {
  Grids grids;
  for (const ElasticStep& step : steps) {
    grids.push_back(std::async(std::launch::async, gridOf, std::cref(cad), step.fit.nodes).share());
  }
  return grids;
}

// Where a stage left the model.
struct ElasticOutcome {
  Placement placed;
  std::string trouble;  // what went wrong; empty: nothing
};

ElasticOutcome fitOnGrid(const TriangleMesh& cad, const FitProblem& problem,
                         const fem::VoxelGrid& grid, const Placement& placed,
                         const ElasticStep& step) {
  std::shared_ptr<ElasticFit> fit;
  try {
    fit = std::make_shared<ElasticFit>(cad, grid, placed, step.fit);
  } catch (const std::invalid_argument& flat) {
    return {placed, std::string("the fit has pressed the model flat (") + flat.what() +
                        "): place the model closer, or correct the contour"};
  }
  const FemStageReport report = fit->fit(
      [&](const Points& x, int k) { return measure(problem, x, settingsAt(step, problem, k)); });
  const Placement moved = [fit](const Points& points) { return fit->carry(points); };
  if (report.solvable) return {moved, ""};
  return {moved, "the elastic system of " + std::to_string(report.nodes) +
                     " nodes has no solution: place the model closer, or correct the contour"};
}

// A model that is still far off somewhere starts again from where it is, with pairs from further
// away, as long as it comes closer. Most are where they belong at once.
Placement comeCloser(const TriangleMesh& cad, const FitProblem& problem, const fem::VoxelGrid& grid,
                     Placement placed, const ElasticStep& step) {
  constexpr int kMostRounds = 5;
  constexpr double kFarOff = 0.015, kClose = 0.003;  // misfit
  constexpr double kCloser = 0.9;                    // of what it was
  // What little of a contour is known says too little of the rest.
  constexpr double kLeastKnown = 0.5;  // part of its length
  if (problem.target.known_length_px < kLeastKnown * problem.target.length_px) return placed;
  double before = misfit(assess(problem, placed(cad.vertices)));
  if (before < kFarOff) return placed;
  for (int round = 0; round < kMostRounds && before > kClose; ++round) {
    const ElasticOutcome outcome = fitOnGrid(cad, problem, grid, placed, step);
    if (!outcome.trouble.empty()) break;
    const double now = misfit(assess(problem, outcome.placed(cad.vertices)));
    if (now > kCloser * before) break;
    before = now;
    placed = outcome.placed;
  }
  return placed;
}

// Stage C: the elastic body on finer and finer grids.
ElasticOutcome fitElasticStages(const TriangleMesh& cad, const FitProblem& problem,
                                const Placement& placed, const std::vector<ElasticStep>& steps,
                                const Grids& grids, StageClock& clock) {
  ElasticOutcome outcome{placed, ""};
  for (size_t k = 0; k < steps.size() && outcome.trouble.empty(); ++k) {
    const fem::VoxelGrid& grid = grids[k].get();
    clock.stop("grid of " + std::to_string(steps[k].fit.nodes));
    outcome = fitOnGrid(cad, problem, grid, outcome.placed, steps[k]);
    clock.stop("elastic " + std::to_string(steps[k].fit.nodes));
    if (k > 0 || steps[k].literal || !outcome.trouble.empty()) continue;
    outcome.placed = comeCloser(cad, problem, grid, outcome.placed, farReaching(steps[k], problem));
    clock.stop("coming closer");
  }
  return outcome;
}

// Where all stages left the model.
struct StagedFit {
  LowOrderFit low;
  Points x;  // its vertices, camera frame
  std::string trouble;
};

StagedFit fitAllStages(const TriangleMesh& cad, const FitProblem& problem,
                       const Eigen::Isometry3d& camera_from_object, const AlignOptions& options,
                       const std::vector<ElasticStep>& steps, const Grids& grids,
                       StageClock& clock) {
  const LowOrderFit low = fitLowOrderStages(problem, options, clock);
  const Placement placed = [&](const Points& points) {
    return low.map.apply(transformed(camera_from_object, points));
  };
  const ElasticOutcome end = fitElasticStages(cad, problem, placed, steps, grids, clock);
  return {low, end.placed(cad.vertices), end.trouble};
}

// Without the planes that the model reaches through, though they push it out. The same where there
// are none.
FitProblem withoutReached(const FitProblem& problem, const Points& x) {
  FitProblem without = problem;
  const double through = reachesThrough(MeasureSettings().support_sigma * problem.model_size);
  auto& supports = without.supports;
  supports.erase(std::remove_if(supports.begin(), supports.end(),
                                [&](const SupportTarget& support) {
                                  const auto height = clearance(support, x, problem.camera);
                                  return !support.stands && height && *height < -through;
                                }),
                 supports.end());
  return without;
}

// A hull is taken for one that floats on the water, not in it, and pressed to the water line. What
// fits clearly better without the plane goes through it; what stands on it fits as well with it.
void tryThroughPlanes(const TriangleMesh& cad, const Eigen::Isometry3d& camera_from_object,
                      const AlignOptions& options, const std::vector<ElasticStep>& steps,
                      const Grids& grids, StageClock& clock, FitProblem& problem, StagedFit& fit) {
  constexpr double kPoorPx = 0.3, kClearlyBetter = 0.6;
  const double mean_px = assess(problem, fit.x).mean_px;
  if (mean_px < kPoorPx || options.method == Method::kLiteral) return;
  FitProblem without = withoutReached(problem, fit.x);
  if (without.supports.size() == problem.supports.size()) return;
  StagedFit through = fitAllStages(cad, without, camera_from_object, options, steps, grids, clock);
  if (!through.trouble.empty() || assess(without, through.x).mean_px > kClearlyBetter * mean_px)
    return;
  problem = std::move(without);
  fit = std::move(through);
}

// Ratio of the root mean square distances from the centroid.
double sizeRatio(const Points& to, const Points& from) {
  return LowOrderMap(to).size() / LowOrderMap(from).size();
}

// Covariance of motion and low-order deformation at the end of the fit, all of them left free.
struct Posterior {
  LowOrderMap here;  // the identity
  Eigen::MatrixXd covariance;
  Eigen::MatrixXd without_placement;  // the same, with the distance left to what was measured
};

Posterior posterior(const FitProblem& problem, const Points& x, const LowOrderStep& last) {
  // What is promised has to hold for placements that are as far off as they may be, too.
  LowOrderPrior prior = last.fit.prior, wide = prior;
  prior.depth *= std::sqrt(3.0);
  wide.depth = 1.5 * kPlacementError * problem.X.col(2).mean() / LowOrderMap(problem.X).size();
  const MeasureSettings settings =
      settingsAt(last, problem, last.fit.iterations - 1, prior.deformation);
  const LowOrderMap here(x);
  const Rows rows = measure(problem, x, settings);
  return {here, covariance(x, rows, prior, here), covariance(x, rows, wide, here)};
}

// What may be off: all that the measurements leave open and the placement allows.
ShapeUncertainty uncertaintyOf(const FitProblem& problem, const Points& x, const LowOrderStep& last,
                               const Posterior& end) {
  const PlacementPrior placement(problem.X.colwise().mean().transpose(), end.here.centroid());
  const auto by_parameters = rigidPart(x, end.here).translation_by_parameters;
  const auto likelihood = [&](const LowOrderMap::Parameters& step) {
    return placement.density(end.here.centroid() + by_parameters * step);
  };
  const double unseen =
      problem.depth.empty() ? unresolved(last.order, last.fit.prior.deformation) : 0.0;
  return shapeUncertainty(x, problem.topology.triangles(), end.here, end.without_placement,
                          problem.model_size, unseen, likelihood);
}

// Of translation of the centroid (camera axes, m) and rotation about it (rad): what the deformation
// leaves open moves and turns the best rigid motion, too.
Eigen::Matrix<double, 6, 6> rigidCovariance(const Points& x, const Posterior& end) {
  const RigidPart rigid = rigidPart(x, end.here);
  Eigen::Matrix<double, 6, LowOrderMap::kParameters> by_parameters;
  by_parameters << rigid.translation_by_parameters, rigid.rotation_by_parameters;
  return by_parameters * end.covariance * by_parameters.transpose();
}

// The same of the object frame's origin, world axes.
Eigen::Matrix<double, 6, 6> poseCovariance(const FitProblem& problem,
                                           const Eigen::Matrix<double, 6, 6>& rigid,
                                           const Eigen::Vector3d& centroid,
                                           const Eigen::Isometry3d& camera_from_object) {
  const Eigen::Vector3d arm = camera_from_object.translation() - centroid;
  Eigen::Matrix<double, 6, 6> J = Eigen::Matrix<double, 6, 6>::Zero();
  const Eigen::Matrix3d R = problem.camera.world_from_camera.linear();
  J.topLeftCorner<3, 3>() = R;
  for (int k = 0; k < 3; ++k) J.block<3, 1>(0, 3 + k) = R * Eigen::Vector3d::Unit(k).cross(arm);
  J.bottomRightCorner<3, 3>() = R;
  return J * rigid * J.transpose();
}

// Deviation of the distance, as part of it.
double distanceSigma(const Eigen::Matrix<double, 6, 6>& rigid, const Eigen::Vector3d& centroid) {
  const Eigen::Vector3d sight = centroid.normalized();
  return std::sqrt(sight.dot(rigid.topLeftCorner<3, 3>() * sight)) / centroid.norm();
}

// Residuals of the target's points, handed to the contour points that they stand for.
std::vector<std::vector<float>> residualsPerLoop(const FitProblem& problem,
                                                 const FitQuality& quality,
                                                 const std::vector<ContourLoop>& contour) {
  std::vector<std::vector<float>> residuals;
  for (const ContourLoop& loop : contour) {
    residuals.emplace_back(loop.points.size(), std::nanf(""));
  }
  const std::vector<TargetPoint>& points = problem.target.points;
  for (size_t k = 0; k < points.size(); ++k) {
    std::vector<float>& loop = residuals[points[k].loop];
    const bool last = k + 1 == points.size() || points[k + 1].loop != points[k].loop;
    const size_t end = last ? loop.size() : points[k + 1].index;
    for (size_t i = points[k].index; i < end; ++i) {
      if (contour[points[k].loop].known[i]) loop[i] = static_cast<float>(quality.residuals[k]);
    }
  }
  return residuals;
}

// Fills in everything that follows from where the vertices ended.
void describe(const FitProblem& problem, const TriangleMesh& cad, const Points& x,
              const std::vector<ContourLoop>& contour, const LowOrderStep& last, bool judge_depth,
              AlignmentResult& result) {
  const Points world = transformed(problem.camera.world_from_camera, x);
  result.world_from_object = bestRigid(cad.vertices, world);
  result.mesh = {transformed(result.world_from_object.inverse(), world), cad.triangles};
  result.rest = cad;
  result.scale = sizeRatio(x, problem.X);
  result.deformation = last.fit.prior.deformation;
  result.noise_px = problem.target.noise_px;
  const Posterior end = posterior(problem, x, last);
  const Eigen::Matrix<double, 6, 6> rigid = rigidCovariance(x, end);
  result.covariance =
      poseCovariance(problem, rigid, end.here.centroid(),
                     problem.camera.world_from_camera.inverse() * result.world_from_object);
  result.distance_sigma = distanceSigma(rigid, end.here.centroid());
  const ShapeUncertainty error =
      judge_depth ? uncertaintyOf(problem, x, last, end) : ShapeUncertainty();
  result.expected_error = error.expected().mean;
  result.expected_rms = error.expected().rms;
  result.off_probability = error.beyond(kTrustedWithin);
  result.shape_off_probability = error.shapeBeyond(kTrustedWithin);
  const FitQuality quality = assess(problem, x);
  result.placed = true;
  result.met_mean_px = quality.met_mean_px;
  result.contour_mean_px = quality.mean_px;
  result.contour_p95_px = quality.p95_px;
  result.residual_px = residualsPerLoop(problem, quality, contour);
  const Verdict verdict =
      judge(problem, contour, quality, result.scale, result.distance_sigma, error);
  result.trusted = verdict.trusted;
  result.reason = verdict.reason;
}

}  // namespace

AlignmentResult unaligned(const TriangleMesh& cad, const Eigen::Isometry3d& pose,
                          const std::string& reason) {
  AlignmentResult result;
  result.world_from_object = pose;
  result.mesh = result.rest = cad;
  result.reason = reason;
  return result;
}

double totalMs(const AlignmentResult& result) {
  double sum = 0.0;
  for (const StageTime& time : result.times) sum += time.ms;
  return sum;
}

AlignmentResult align(const TriangleMesh& cad, const Camera& camera,
                      const Eigen::Isometry3d& initial_world_from_object,
                      const std::vector<ContourLoop>& contour, const AlignOptions& options) {
  AlignmentResult result;
  StageClock clock(result.times);
  FitProblem problem = makeFitProblem(cad, camera, initial_world_from_object, contour, options);
  clock.stop("contour");
  const RoughCheck check = checkPlacement(problem);
  if (!check.usable) return unaligned(cad, initial_world_from_object, check.reason);

  const std::vector<ElasticStep> steps = elasticSteps(problem, options);
  const Grids grids = layGrids(cad, steps);
  const Eigen::Isometry3d camera_from_object =
      camera.world_from_camera.inverse() * initial_world_from_object;
  StagedFit fit = fitAllStages(cad, problem, camera_from_object, options, steps, grids, clock);
  tryThroughPlanes(cad, camera_from_object, options, steps, grids, clock, problem, fit);
  describe(problem, cad, fit.x, contour, fit.low.last, options.judge_depth, result);
  if (!fit.trouble.empty()) {
    result.trusted = false;
    result.reason = fit.trouble + (result.reason.empty() ? "" : "; " + result.reason);
  }
  clock.stop("result");
  return result;
}

}  // namespace calipso::align

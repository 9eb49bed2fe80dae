#include "calipso_render/light_fit.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "draw/side_by_side.hpp"
#include "light/ambient_fit.hpp"
#include "light/cluster_split.hpp"
#include "light/gloss_fit.hpp"
#include "light/light_search.hpp"
#include "light/reflectance_cost.hpp"
#include "light/sun_prior.hpp"

namespace calipso::render {
namespace {

constexpr int kFewestSamples = 60;
constexpr std::size_t kStarts = 3;
constexpr double kTelling = 3.0;  // of log-likelihood: a direction is better than most
// of log-likelihood: cast shadows are seen where this light casts them
constexpr double kShadowsSpeak = 12.0;
// of log-likelihood, by which they are seen there better than kAside (rad) beside it: a dark place
// that the shadow meets from many directions tells none of them
constexpr double kShadowsTell = 4.0;
constexpr float kAside = 0.35f;
constexpr double kRobust = 0.15;  // relative residual beyond which a pixel counts less
// of a light's colour: e^4 times brighter or darker than the unit
constexpr double kLogRange = 4.0;
// relative, of the shading of a sample, of which so many err independently of each other
constexpr double kShadingError = 0.1, kIndependentSamples = 50.0;
constexpr int kSplits = 2;               // rounds of telling reflectances of one hue apart
constexpr float kDielectric = 0.04f;     // reflectance at normal incidence, refraction 1.5
constexpr float kBrightestPlace = 0.9f;  // reflectance
constexpr double kPriorWeight = 0.05;    // of one prior, as a part of all pixels

// Every parameter of the model; blocks as in ReflectanceCost.
struct Unknowns {
  Eigen::Vector3d direction, ambient, sun;
  double gradient = kSkyGradient;
  Eigen::Vector2d gloss = {std::log(0.03), std::log(0.3)};
  std::vector<Eigen::Vector3d> albedos;
};

// Pulls a block of one number towards a value.
class Prior : public ceres::SizedCostFunction<1, 1> {
 public:
  Prior(double value, double weight) : value_(value), weight_(weight) {}
  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    residual[0] = weight_ * (x[0][0] - value_);
    if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = weight_;
    return true;
  }

 private:
  double value_, weight_;
};

// The same for the logarithms of ks and m.
class GlossPrior : public ceres::SizedCostFunction<2, 2> {
 public:
  explicit GlossPrior(double weight) : weight_(weight) {}
  bool Evaluate(double const* const* x, double* residual, double** jacobians) const override {
    const Unknowns typical;
    for (int i = 0; i < 2; ++i) residual[i] = weight_ * (x[0][i] - typical.gloss[i]);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      jacobians[0][0] = jacobians[0][3] = weight_;
      jacobians[0][1] = jacobians[0][2] = 0.0;
    }
    return true;
  }

 private:
  double weight_;
};

Eigen::Vector3d logOf(const cv::Vec3f& c) {
  return Eigen::Vector3d(c[0], c[1], c[2]).array().max(1e-4).log();
}

cv::Vec3f expOf(const Eigen::Vector3d& x) {
  return {static_cast<float>(std::exp(x[0])), static_cast<float>(std::exp(x[1])),
          static_cast<float>(std::exp(x[2]))};
}

std::vector<cv::Vec3f> meanRadiance(const std::vector<LightSample>& samples, int clusters) {
  std::vector<cv::Vec3f> sums(clusters);
  std::vector<int> counts(clusters, 0);
  for (const LightSample& s : samples) sums[s.cluster] += s.radiance, ++counts[s.cluster];
  for (int k = 0; k < clusters; ++k)
    sums[k] = sums[k] * (1.0f / std::max(1, counts[k])) + cv::Vec3f::all(1e-3f);
  return sums;
}

class Fit {
 public:
  // @param direction_free false: cast shadows know it better
  Fit(const LightEvidence& evidence, const Eigen::Vector3f& up, bool direction_free)
      : evidence_(evidence),
        direction_free_(direction_free),
        up_(up.cast<double>()),
        means_(meanRadiance(evidence.samples, evidence.clusters)) {}

  // Four passes, then everything; twice, since the shadows hang on the direction found.
  double run(const LightCandidate& start, Unknowns& x) {
    x.direction = start.direction.cast<double>();
    x.ambient = logOf(start.ambient), x.sun = logOf(start.sun);
    for (const cv::Vec3f& mean : means_) x.albedos.push_back(logOf(mean));
    double cost = 0.0;
    for (int round = 0; round < (direction_free_ ? 2 : 1); ++round) {
      using Blocks = std::array<bool, 3>;  // light, albedo, gloss free?
      ceres::Problem problem;
      build(problem, x);
      for (const Blocks& free : {Blocks{true, false, false},
                                 {false, true, false},
                                 {false, false, true},
                                 {true, true, true}}) {
        cost = solve(problem, x, free);
      }
    }
    return cost;
  }

 private:
  void build(ceres::Problem& problem, Unknowns& x) const {
    const Eigen::Vector3f l = x.direction.cast<float>();
    for (const LightSample& s : evidence_.samples) {
      ReflectanceCost::Sample r;
      r.normal = s.normal.cast<double>(), r.view = s.view.cast<double>(), r.up = up_;
      r.radiance = Eigen::Vector3d(s.radiance[0], s.radiance[1], s.radiance[2]);
      r.visible = evidence_.visible ? evidence_.visible(s, l) : 1.0f;
      const GreyLight around = greyLight(s.seen, up_.cast<float>(), l);
      r.below = Eigen::Array3d(evidence_.below[0], evidence_.below[1], evidence_.below[2]);
      r.even = around.even, r.lean = around.lean, r.thrown_sun = around.sun;
      r.scale = (means_[s.cluster][0] + means_[s.cluster][1] + means_[s.cluster][2]) / 3.0;
      problem.AddResidualBlock(new ReflectanceCost(r), new ceres::SoftLOneLoss(kRobust),
                               x.direction.data(), x.ambient.data(), x.sun.data(), &x.gradient,
                               x.albedos[s.cluster].data(), x.gloss.data());
    }
    const double weight = std::sqrt(kPriorWeight * evidence_.samples.size());
    problem.AddResidualBlock(new Prior(kSkyGradient, 0.5 * weight), nullptr, &x.gradient);
    problem.AddResidualBlock(new GlossPrior(0.05 * weight), nullptr, x.gloss.data());
    const double unit = kShadingError * std::sqrt(evidence_.samples.size() / kIndependentSamples);
    problem.AddResidualBlock(new SunPriorCost(up_, unit), nullptr, x.direction.data(),
                             x.ambient.data(), x.sun.data());
    problem.SetManifold(x.direction.data(), new ceres::SphereManifold<3>);
    for (int c = 0; c < 3; ++c) {
      problem.SetParameterLowerBound(x.sun.data(), c, -kLogRange),
          problem.SetParameterUpperBound(x.sun.data(), c, kLogRange);
      problem.SetParameterLowerBound(x.ambient.data(), c, -kLogRange),
          problem.SetParameterUpperBound(x.ambient.data(), c, kLogRange);
    }
    // Without light no albedo is too high.
    for (Eigen::Vector3d& a : x.albedos) {
      for (int c = 0; problem.HasParameterBlock(a.data()) && c < 3; ++c)
        problem.SetParameterUpperBound(a.data(), c, 2.0 * kLogRange);
    }
    problem.SetParameterLowerBound(&x.gradient, 0, 0.0);
    problem.SetParameterUpperBound(&x.gradient, 0, 0.9);
    problem.SetParameterLowerBound(x.gloss.data(), 1, std::log(0.03));
    problem.SetParameterUpperBound(x.gloss.data(), 1, std::log(0.8));
    problem.SetParameterUpperBound(x.gloss.data(), 0, std::log(0.5));
  }

  double solve(ceres::Problem& problem, Unknowns& x, const std::array<bool, 3>& free) const {
    const auto hold = [&](double* block, bool is_free) {
      if (!problem.HasParameterBlock(block)) return;
      if (is_free)
        problem.SetParameterBlockVariable(block);
      else
        problem.SetParameterBlockConstant(block);
    };
    hold(x.direction.data(), free[0] && direction_free_), hold(x.sun.data(), free[0]),
        hold(&x.gradient, free[0]);
    // Brightness is shared between light and albedo: the ambient light is the unit.
    hold(x.ambient.data(), free[0] && !free[1]);
    for (Eigen::Vector3d& a : x.albedos) hold(a.data(), free[1]);
    hold(x.gloss.data(), free[2]);
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.max_num_iterations = free[0] && free[1] ? 25 : 8;
    options.logging_type = ceres::SILENT;
    options.num_threads = 1;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    return summary.final_cost;
  }

  const LightEvidence& evidence_;
  bool direction_free_;
  Eigen::Vector3d up_;
  std::vector<cv::Vec3f> means_;
};

LightFit toFit(const Unknowns& x, const cv::Vec3f& below, const Eigen::Vector3f& up, double cost) {
  LightFit fit;
  fit.determined = true;
  fit.cost = cost;
  fit.light.direction = x.direction.cast<float>();
  const cv::Vec3f A = expOf(x.ambient);
  fit.light.sun = expOf(x.sun), fit.light.ambient[0] = A;
  const cv::Vec3f more =
      A - below * static_cast<float>((1.0 - x.gradient) * (A[0] + A[1] + A[2]) / 3.0);
  // Band 1 of the harmonics is ordered y, z, x.
  for (int i = 0; i < 3; ++i) fit.light.ambient[1 + i] = more * up[(i + 1) % 3];
  const float ks = static_cast<float>(std::exp(x.gloss[0]));
  fit.gloss = {ks, static_cast<float>(std::exp(x.gloss[1])), ks};
  for (const Eigen::Vector3d& a : x.albedos) fit.albedos.push_back(expOf(a));
  return fit;
}

// Nothing if the light found is below the horizon.
std::optional<LightFit> fitFrom(const LightCandidate& start, const LightEvidence& evidence,
                                const Eigen::Vector3f& up, bool direction_free) {
  Unknowns x;
  const double cost = Fit(evidence, up, direction_free).run(start, x);
  if (x.direction.dot(up.cast<double>()) <= 0.0) return std::nullopt;
  return toFit(x, evidence.below, up, cost);
}

void keepBetter(const std::optional<LightFit>& fit, LightFit& best) {
  if (!fit || (best.determined && fit->cost >= best.cost)) return;
  const bool from_shadows = best.from_shadows;
  best = *fit;
  best.from_shadows = from_shadows;
}

double shadowMisfit(const LightEvidence& evidence, const LightCandidate& c) {
  return evidence.shadow_misfit ? evidence.shadow_misfit(c.direction) : 0.0;
}

// Cast shadows speak for this direction, and not for those beside it.
bool shadowsTell(const LightEvidence& evidence, const LightCandidate& c,
                 const Eigen::Vector3f& up) {
  const double here = shadowMisfit(evidence, c);
  if (here >= -kShadowsSpeak) return false;
  constexpr int kBeside = 12;
  const Eigen::Vector3f s = c.direction.unitOrthogonal(), t = c.direction.cross(s);
  for (int i = 0; i < kBeside; ++i) {
    const float a = static_cast<float>(2.0 * M_PI * i / kBeside);
    const Eigen::Vector3f l =
        std::cos(kAside) * c.direction + std::sin(kAside) * (std::cos(a) * s + std::sin(a) * t);
    if (l.dot(up) > 0.0f && evidence.shadow_misfit(l) < here + kShadowsTell) return false;
  }
  return true;
}

// Dark places that hardly look like shadows count for nothing.
LightEvidence withoutShadows(LightEvidence evidence) {
  evidence.shadow_misfit = {}, evidence.shadow_candidates.clear();
  return evidence;
}

// Light, albedos and gloss from shading and cast shadows.
LightFit fitShading(const LightEvidence& evidence, const Eigen::Vector3f& up) {
  LightFit best;
  if (evidence.known_sun) {
    best.from_shadows = true;
    keepBetter(fitFrom(lightFrom(*evidence.known_sun, evidence, up), evidence, up, false), best);
    return best;
  }
  std::vector<LightCandidate> starts = searchLight(evidence, up, kStarts);
  best.from_shadows = shadowsTell(evidence, starts.front(), up);
  if (!best.from_shadows) starts = searchLight(withoutShadows(evidence), up, kStarts);
  if (!best.from_shadows) {
    std::vector<std::optional<LightFit>> fits(starts.size());
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t i = 0; i < starts.size(); ++i)
      fits[i] = fitFrom(starts[i], evidence, up, true);
    for (const std::optional<LightFit>& fit : fits) keepBetter(fit, best);
  }
  // Shading alone may lead below the horizon: then the search's direction stands, if it stands out,
  // as it does where shadows tell it.
  if (best.determined || (!best.from_shadows && starts.front().contrast <= kTelling)) return best;
  std::optional<LightFit> fit;
  std::optional<SunByBorders> by_borders;
  std::vector<std::function<void()>> works = {
      [&] { fit = fitFrom(starts.front(), evidence, up, false); }};
  if (best.from_shadows && evidence.borders)
    works.emplace_back([&] { by_borders = evidence.borders(starts.front().direction); });
  doAll(true, works);
  keepBetter(fit, best);
  best.by_borders = by_borders;
  return best;
}

// What surfaces mirror from where a picture shows what is there. A dielectric mirrors a known part,
// F_0, of it, and so it needs neither the light's unit nor what dark pixels tell of light from below.
//   G = (F_0 / kb) I    G  in the light's units    I  radiance in the picture
// Where that is brighter than almost white under the light found, kb is not a dielectric's. All of it
// is put straight towards the place, none of it the other way.
void mirrorPlace(const Eigen::Vector3f& towards, const cv::Vec3f& radiance,
                 const Eigen::Vector3f& up, LightFit& fit) {
  const cv::Vec3f place = radiance * (kDielectric / fit.gloss.around),
                  white = kBrightestPlace * diffuseShading(fit.light, up, 1.0f);
  float part = 1.0f;
  for (int c = 0; c < 3; ++c) part = std::min(part, white[c] / std::max(place[c], 1e-6f));
  const cv::Vec3f more = 0.5f * (part * place - ambientAt(asMirrored(fit.light), towards));
  fit.light.mirrored[0] += more;
  // Band 1 is ordered y, z, x.
  for (int i = 0; i < 3; ++i) fit.light.mirrored[1 + i] += more * towards[(i + 1) % 3];
}

// The ground, and what the objects' rims mirror: at grazing views that lies behind them.
// @param view towards the camera
void mirrorPlaces(const LightEvidence& evidence, const Eigen::Vector3f& up,
                  const Eigen::Vector3f& view, LightFit& fit) {
  if (!(fit.gloss.around > 0.0f)) return;
  if (evidence.below_brightness > 0.0f)
    mirrorPlace(-up, evidence.below * evidence.below_brightness, up, fit);
  if (evidence.behind != cv::Vec3f()) mirrorPlace(-view, evidence.behind, up, fit);
}

}  // namespace

std::optional<SeenGloss> LightFit::toldGloss(std::size_t object) const {
  if (!confirmed()) return std::nullopt;
  const auto& own = seen_gloss.of_one;
  return object < own.size() && own[object] ? own[object] : seen_gloss.of_all;
}

Gloss LightFit::glossOf(std::size_t object) const {
  const auto& own = seen_gloss.of_one;
  if (object >= own.size() || !own[object]) return gloss;
  return {own[object]->gloss.specular, own[object]->gloss.roughness, gloss.around};
}

std::vector<Gloss> LightFit::glosses(const std::vector<bool>& cloth) const {
  const bool all_cloth = std::find(cloth.begin(), cloth.end(), false) == cloth.end();
  std::vector<Gloss> all;
  for (std::size_t i = 0; i < cloth.size(); ++i) {
    const bool own = i < seen_gloss.of_one.size() && seen_gloss.of_one[i];
    const bool told = confirmed() && (own || (all_cloth && seen_gloss.of_all));
    all.push_back(cloth[i] && !told ? Gloss() : glossOf(i));
  }
  return all;
}

LightFit fitLight(const LightEvidence& seen, const Eigen::Vector3f& up,
                  const Eigen::Vector3f& view) {
  LightFit best;
  best.light.direction = (up + 0.4f * view).normalized();
  if (static_cast<int>(seen.samples.size()) < kFewestSamples) return best;
  LightEvidence evidence = seen;
  if (const LightFit fit = fitShading(evidence, up); fit.determined) best = fit;
  if (!best.determined) return best;
  for (int i = 0; i < kSplits; ++i) {
    LightEvidence apart = evidence;
    if (!splitClusters(best, apart)) break;
    const LightFit fit = fitShading(apart, up);
    if (!fit.determined) break;
    best = fit, evidence = apart;
  }
  if (evidence.gloss) best.seen_gloss = evidence.gloss(best, evidence);
  if (best.seen_gloss.of_all) best.gloss = best.seen_gloss.of_all->gloss;
  best.gloss.around = surroundingsStrength(evidence, best);
  best.second_order = refineAmbient(evidence, best);
  if (best.from_shadows) mirrorPlaces(evidence, up, view, best);
  return best;
}

}  // namespace calipso::render

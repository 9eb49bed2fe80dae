#include "light/light_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "light/sun_prior.hpp"

namespace calipso::render {
namespace {

// tried over the upper hemisphere, without the objects' own shadows
constexpr int kDirections = 400;
constexpr std::size_t kKept = 10;  // of those, tried with them
constexpr float kApart = 0.94f;    // cosine of the angle between two of them
// the same between two that cast shadows speak for: 4 degrees
constexpr float kShadowApart = 0.9976f;
constexpr float kLowestSun = 0.08f;                     // sine of its elevation
constexpr double kLeastRatio = 0.1, kMostRatio = 10.0;  // of sun to ambient light
constexpr int kRatios = 20;
constexpr double kShadingWeight = 50.0;  // pixels that err independently of each other
constexpr std::size_t kSearchSamples = 1200;
constexpr float kFirstStep = 0.08f, kLastStep = 0.006f;  // rad, of the refinement

using Visible = std::function<float(const LightSample&, const Eigen::Vector3f&)>;

// Evenly spread over the sphere (Fibonacci), those above the horizon.
std::vector<Eigen::Vector3f> candidateDirections(const Eigen::Vector3f& up) {
  std::vector<Eigen::Vector3f> directions;
  for (int i = 0; i < kDirections * 2; ++i) {
    const float z = 1.0f - (2 * i + 1.0f) / (2 * kDirections), r = std::sqrt(1.0f - z * z),
                a = i * 2.39996323f;
    const Eigen::Vector3f d(r * std::cos(a), r * std::sin(a), z);
    if (d.dot(up) > kLowestSun) directions.push_back(d);
  }
  return directions;
}

// Sums of one cluster's channel for I = a (p + q s): p the ambient light's profile, s = V max(0,
// n.l).
struct LineSums {
  double n = 0, i = 0, pp = 0, ps = 0, ss = 0, ip = 0, is = 0, ii = 0;

  double albedo(double q) const {
    return std::max(0.0, ip + q * is) / std::max(pp + q * (2.0 * ps + q * ss), 1e-12);
  }
  // Sum of squares at the best a, relative to the mean brightness.
  double error(double q) const {
    const double a = albedo(q), mean = i / n + 1e-4;
    return std::max(0.0, ii - 2.0 * a * (ip + q * is) + a * a * (pp + q * (2.0 * ps + q * ss))) /
           (mean * mean);
  }
};

using ClusterSums = std::vector<std::array<LineSums, 3>>;

// Ratios of sun to ambient light that are tried; 0 first.
struct Ratio {
  double value, unusual;
};
using Ratios = std::array<Ratio, kRatios + 2>;

const Ratios& ratios() {
  static const Ratios all = [] {
    Ratios r{};
    r[0] = {0.0, unusualStrength(std::log(kLeastRatio))};
    for (int i = 0; i <= kRatios; ++i) {
      const double q =
          kLeastRatio * std::pow(kMostRatio / kLeastRatio, static_cast<double>(i) / kRatios);
      r[i + 1] = {q, unusualStrength(std::log(q))};
    }
    return r;
  }();
  return all;
}

using RatioErrors = std::array<double, kRatios + 2>;

// By the ratio, which all clusters share.
RatioErrors errorsOf(const ClusterSums& sums, int channel) {
  RatioErrors errors{};
  for (std::size_t i = 0; i < errors.size(); ++i) {
    for (const auto& cluster : sums) {
      if (cluster[channel].n >= 8) errors[i] += cluster[channel].error(ratios()[i].value);
    }
  }
  return errors;
}

// @param per_unit error that weighs as much as a unit of log-likelihood
std::size_t likeliestRatio(const RatioErrors& errors, double per_unit) {
  const auto cost = [&](std::size_t i) { return errors[i] + per_unit * ratios()[i].unusual; };
  std::size_t best = 0;
  for (std::size_t i = 1; i < errors.size(); ++i) {
    if (cost(i) < cost(best)) best = i;
  }
  return best;
}

template <typename Judge>
std::vector<LightCandidate> judged(const std::vector<Eigen::Vector3f>& directions, Judge judge) {
  std::vector<LightCandidate> candidates(directions.size());
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t i = 0; i < directions.size(); ++i) candidates[i] = judge(directions[i]);
  return candidates;
}

class Search {
 public:
  Search(const LightEvidence& evidence, const Eigen::Vector3f& up)
      : evidence_(evidence), up_(up), prior_(evidence.shadow_misfit ? 0.0 : 1.0) {
    const std::size_t step = std::max<std::size_t>(1, evidence.samples.size() / kSearchSamples);
    for (std::size_t i = 0; i < evidence.samples.size(); i += step)
      samples_.push_back(evidence.samples[i]);
  }

  // One albedo per cluster and channel; the errors count relative to the cluster's brightness.
  LightCandidate byShading(const Eigen::Vector3f& l, const Visible& visible) const {
    ClusterSums sums(evidence_.clusters);
    for (const LightSample& x : samples_) {
      const float cosine = x.normal.dot(l);
      const GreyLight around = greyLight(x.seen, up_, l);
      const double s =
          (cosine > 0.0f ? cosine * (visible ? visible(x, l) : 1.0f) : 0.0f) + around.sun;
      for (int c = 0; c < 3; ++c) {
        const double p =
            around.even + (1.0 - (1.0 - kSkyGradient) * evidence_.below[c]) * around.lean;
        LineSums& m = sums[x.cluster][c];
        const double i = x.radiance[c];
        m.n += 1, m.i += i, m.pp += p * p, m.ps += p * s, m.ss += s * s, m.ip += i * p,
            m.is += i * s, m.ii += i * i;
      }
    }
    return likeliest(sums, l);
  }

  LightCandidate byAll(const Eigen::Vector3f& l) const {
    LightCandidate candidate = byShading(l, evidence_.visible);
    if (evidence_.shadow_misfit) candidate.misfit += evidence_.shadow_misfit(l);
    return candidate;
  }

  // Steps along two tangents, halved when none leads on. One of each at a time, so that all of them
  // can be judged at once.
  void refine(std::vector<LightCandidate>& candidates) const {
    std::vector<float> steps(candidates.size(), kFirstStep);
    for (;;) {
      std::vector<Eigen::Vector3f> directions;
      std::vector<std::size_t> of;
      for (std::size_t i = 0; i < candidates.size(); ++i) {
        if (!(steps[i] > kLastStep)) continue;
        const std::vector<Eigen::Vector3f> beside = around(candidates[i].direction, steps[i]);
        directions.insert(directions.end(), beside.begin(), beside.end());
        of.insert(of.end(), beside.size(), i);
      }
      if (directions.empty()) return;
      const std::vector<LightCandidate> tried =
          judged(directions, [this](const Eigen::Vector3f& l) { return byAll(l); });
      std::vector<bool> better(candidates.size(), false);
      for (std::size_t k = 0; k < tried.size(); ++k) {
        LightCandidate& best = candidates[of[k]];
        if (tried[k].misfit < best.misfit - 1e-6) best = tried[k], better[of[k]] = true;
      }
      for (std::size_t i = 0; i < candidates.size(); ++i) {
        if (!better[i]) steps[i] *= 0.5f;
      }
    }
  }

 private:
  // Those above the horizon of four a step away along two tangents.
  std::vector<Eigen::Vector3f> around(const Eigen::Vector3f& centre, float step) const {
    const Eigen::Vector3f s = centre.unitOrthogonal(), t = centre.cross(s);
    std::vector<Eigen::Vector3f> beside;
    for (const Eigen::Vector3f& d : {s, Eigen::Vector3f(-s), t, Eigen::Vector3f(-t)}) {
      const Eigen::Vector3f l = (centre + step * d).normalized();
      if (!(l.dot(up_) < kLowestSun)) beside.push_back(l);
    }
    return beside;
  }

  // The errors' size is not known: its likelihood is profiled out.
  LightCandidate likeliest(const ClusterSums& sums, const Eigen::Vector3f& l) const {
    std::array<RatioErrors, 3> errors;
    double least = 0.0;
    for (int c = 0; c < 3; ++c) {
      errors[c] = errorsOf(sums, c);
      least += *std::min_element(errors[c].begin(), errors[c].end());
    }
    LightCandidate total;
    total.direction = l;
    double error = 0.0, unusual = unusualHeight(l.dot(up_));
    for (int c = 0; c < 3; ++c) {
      const std::size_t i = likeliestRatio(errors[c], prior_ * least / kShadingWeight);
      const double q = ratios()[i].value;
      error += errors[c][i], unusual += ratios()[i].unusual;
      total.ambient[c] = static_cast<float>(std::max(0.1, 1.0 / (1.0 + q)));
      total.sun[c] = static_cast<float>(std::max(0.05, q / (1.0 + q)));
    }
    total.misfit = kShadingWeight * std::log(error / samples_.size() + 1e-6) + prior_ * unusual;
    return total;
  }

  const LightEvidence& evidence_;
  Eigen::Vector3f up_;
  double prior_;  // weight of what suns usually are: none where cast shadows are to tell
  std::vector<LightSample> samples_;
};

bool better(const LightCandidate& a, const LightCandidate& b) { return a.misfit < b.misfit; }

// The first `count` of them that are apart from each other.
std::vector<LightCandidate> spread(const std::vector<LightCandidate>& sorted, float apart,
                                   std::size_t count) {
  std::vector<LightCandidate> chosen;
  for (const LightCandidate& candidate : sorted) {
    if (chosen.size() == count) break;
    const bool far = std::all_of(chosen.begin(), chosen.end(), [&](const LightCandidate& b) {
      return b.direction.dot(candidate.direction) < apart;
    });
    if (far) chosen.push_back(candidate);
  }
  return chosen;
}

std::vector<Eigen::Vector3f> directionsOf(const std::vector<LightCandidate>& candidates) {
  std::vector<Eigen::Vector3f> directions;
  for (const LightCandidate& c : candidates) directions.push_back(c.direction);
  return directions;
}

}  // namespace

LightCandidate lightFrom(const Eigen::Vector3f& to_sun, const LightEvidence& evidence,
                         const Eigen::Vector3f& up) {
  return Search(evidence, up).byShading(to_sun, evidence.visible);
}

std::vector<LightCandidate> searchLight(const LightEvidence& evidence, const Eigen::Vector3f& up,
                                        std::size_t count) {
  const Search search(evidence, up);
  const auto by_all = [&](const Eigen::Vector3f& l) { return search.byAll(l); };
  std::vector<LightCandidate> all = judged(
      candidateDirections(up), [&](const Eigen::Vector3f& l) { return search.byShading(l, {}); });
  std::stable_sort(all.begin(), all.end(), better);
  std::vector<LightCandidate> kept = judged(directionsOf(spread(all, kApart, kKept)), by_all);
  std::vector<Eigen::Vector3f> cast;
  for (const Eigen::Vector3f& l : evidence.shadow_candidates) {
    if (l.dot(up) > kLowestSun) cast.push_back(l);
  }
  std::vector<LightCandidate> from_shadows = judged(cast, by_all);
  std::stable_sort(from_shadows.begin(), from_shadows.end(), better);
  for (const LightCandidate& c : spread(from_shadows, kShadowApart, count)) kept.push_back(c);
  std::stable_sort(kept.begin(), kept.end(), better);
  kept.resize(std::min(kept.size(), count));
  const double contrast = all[all.size() / 2].misfit - all.front().misfit;
  search.refine(kept);
  for (LightCandidate& c : kept) c.contrast = contrast;
  std::stable_sort(kept.begin(), kept.end(), better);
  return kept;
}

}  // namespace calipso::render

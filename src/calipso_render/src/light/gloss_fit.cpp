#include "light/gloss_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

namespace calipso::render {
namespace {

constexpr float kSaturated = 0.95f;  // linear; the surface may be brighter than that
constexpr std::size_t kFewest = 30;
constexpr double kSmoothest = 0.03, kRoughest = 0.7;  // m
constexpr int kRoughnesses = 24;
constexpr int kReweightings = 4;
constexpr double kNormalError = 0.02;  // rad per axis: no model has the object's own
constexpr double kModelError = 1.5;    // of m, whatever the rows' errors say
constexpr double kOutlier = 0.15;      // of the cluster's brightness
// of the worst roughness' error: less must remain, or the roughness is not told
constexpr double kSharp = 0.98;
constexpr double kBroad = 0.35;      // m from which a lobe looks like diffuse shading
constexpr double kNarrowPart = 0.5;  // of its roughness, that a narrow one beside it has at most
// rows' mean errors by which the narrow one has to make the fit better
constexpr double kSeenBeside = 15.0;
// rows' mean errors within which another roughness explains the highlights as well
constexpr double kAlike = 6.0;
// ... and hardly any worse: what pixels and normals blur is seldom smoother than all that is tried
constexpr double kSame = 1.0;
// Directions beside the light's, and how far (rad), that highlights have to speak against; by so
// many samples, and every so manieth roughness.
constexpr int kBesides = 8, kTriedStep = 3;
constexpr float kBeside = 0.1f;
constexpr std::size_t kTriedWith = 900;
// of the error without gloss: less must remain, or no highlight was seen
constexpr double kExplained = 0.97;

// I_c = x_k a_kc E_c + ks G_c + kb B_c, linear in the clusters' brightness x, in ks and in kb.
struct Row {
  int cluster;
  cv::Vec3f diffuse, radiance, sun, mirrored;  // a E; I; L V; F A S
  double scale;
  double weight = 1.0;
};

struct Solution {
  double strength = 0.0, beside = 0.0;  // of Lobes' own, and of what goes with the broad one
  double cost = 1e30;
};

// Lobes of the rows whose strengths are unknown: the one in question, and a broad one beside it.
// nullptr: there is none.
struct Lobes {
  const std::vector<double>* own = nullptr;
  const std::vector<double>* broad = nullptr;
};

// Normal equations of the lobes' strengths, the clusters' brightness eliminated: each cluster meets
// only itself and them.
struct Reduced {
  std::vector<double> dd, di;
  std::vector<Eigen::Vector2d> dg;
  Eigen::Matrix2d gg = 1e-12 * Eigen::Matrix2d::Identity();
  Eigen::Vector2d gi = Eigen::Vector2d::Zero();
  explicit Reduced(int clusters)
      : dd(clusters, 1e-9), di(clusters, 0.0), dg(clusters, Eigen::Vector2d::Zero()) {}
  void add(int k, double w, double d, const Eigen::Vector2d& g, double x) {
    dd[k] += w * d * d, dg[k] += w * d * g, di[k] += w * d * x, gg += w * g * g.transpose(),
        gi += w * g * x;
  }
  Eigen::Vector2d strengths() const {
    Eigen::Matrix2d left = gg;
    Eigen::Vector2d right = gi;
    for (std::size_t k = 0; k < dd.size(); ++k)
      left -= dg[k] * dg[k].transpose() / dd[k], right -= dg[k] * di[k] / dd[k];
    const auto alone = [&](int i) {
      return left(i, i) > 1e-12 ? std::max(0.0, right[i] / left(i, i)) : 0.0;
    };
    const double determinant = left.determinant();
    if (determinant > 1e-9 * left(0, 0) * left(1, 1)) {
      const Eigen::Vector2d both = left.inverse() * right;
      if (both.minCoeff() >= 0.0) return both;
    }
    // No strength is negative: then one of them is 0, the one that explains less alone.
    const Eigen::Vector2d own(alone(0), 0.0), broad(0.0, alone(1));
    return right.dot(own) >= right.dot(broad) ? own : broad;
  }
};

// Whether a channel tells no more than that the surface is at least as bright.
bool clipped(float radiance, double model) { return radiance >= kSaturated && model >= radiance; }

Solution solve(const std::vector<Row>& rows, const Lobes& lobes, int clusters) {
  constexpr double kBound = 3.0 * kOutlier * kOutlier;
  const auto glossOf = [&](std::size_t i, int c) {
    const double mirrored = rows[i].mirrored[c];  // goes with the broader one
    const double own = lobes.own == nullptr ? 0.0
                                            : rows[i].sun[c] * (*lobes.own)[i] +
                                                  (lobes.broad == nullptr ? mirrored : 0.0);
    return Eigen::Vector2d(
        own, lobes.broad == nullptr ? 0.0 : rows[i].sun[c] * (*lobes.broad)[i] + mirrored);
  };
  std::vector<cv::Vec3d> weights(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (int c = 0; c < 3; ++c) weights[i][c] = rows[i].radiance[c] < kSaturated ? 1.0 : 0.0;
  }
  Solution solution;
  for (int round = 0; round < kReweightings; ++round) {
    Reduced sums(clusters);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      for (int c = 0; c < 3; ++c)
        sums.add(rows[i].cluster, rows[i].weight * weights[i][c] / (rows[i].scale * rows[i].scale),
                 rows[i].diffuse[c], glossOf(i, c), rows[i].radiance[c]);
    }
    const Eigen::Vector2d strengths = sums.strengths();
    solution.strength = strengths[0], solution.beside = strengths[1], solution.cost = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const int k = rows[i].cluster;
      const double brightness = (sums.di[k] - strengths.dot(sums.dg[k])) / sums.dd[k];
      double squared = 0.0;
      cv::Vec3d tells;
      for (int c = 0; c < 3; ++c) {
        const double model = brightness * rows[i].diffuse[c] + strengths.dot(glossOf(i, c));
        const double r = (model - rows[i].radiance[c]) / rows[i].scale;
        tells[c] = clipped(rows[i].radiance[c], model) ? 0.0 : 1.0;
        squared += tells[c] * r * r;
      }
      // Cauchy's loss: a highlight that is not explained goes on counting.
      solution.cost += rows[i].weight * kBound * std::log1p(squared / kBound);
      weights[i] = tells * (kBound / (squared + kBound));
    }
  }
  return solution;
}

double weightOf(const std::vector<Row>& rows) {
  double sum = 0.0;
  for (const Row& r : rows) sum += r.weight;
  return sum;
}

// Lets places at every angle from the mirror direction weigh alike: far from it are most of them,
// and all that they tell is how the diffuse shading errs.
void balance(const std::vector<HighlightSample>& highlights, const Eigen::Vector3f& light,
             std::vector<Row>& rows) {
  constexpr float kRing = 0.05f;  // rad
  constexpr double kPerRing = 50.0;
  std::vector<std::size_t> rings, counts;
  for (const HighlightSample& h : highlights) {
    const float c = h.at.normal.dot((light + h.at.view).normalized());
    rings.push_back(static_cast<std::size_t>(std::acos(std::min(1.0f, c)) / kRing));
    counts.resize(std::max(counts.size(), rings.back() + 1));
    ++counts[rings.back()];
  }
  for (std::size_t i = 0; i < rows.size(); ++i)
    rows[i].weight = std::min(1.0, kPerRing / static_cast<double>(counts[rings[i]]));
}

Row rowOf(const LightSample& s, const LightFit& fit, const SunVisible& visible) {
  const Light& light = fit.light;
  const float sun = visible ? visible(s, light.direction) : 1.0f;
  const Eigen::Vector3f mirrored = mirroredIn(s.normal, s.view);
  Row row;
  row.cluster = s.cluster;
  row.diffuse = fit.albedos[s.cluster].mul(
      diffuseShading(light, s.normal, sun, s.seen, cv::Vec3f::all(kThrownBack)));
  row.radiance = s.radiance, row.sun = light.sun * sun;
  row.mirrored =
      ambientAt(light, mirrored) * (skyMirrored(s.seen, mirrored) * grazing(s.normal.dot(s.view)));
  row.scale = (row.diffuse[0] + row.diffuse[1] + row.diffuse[2]) / 3.0 + 1e-3;
  return row;
}

double roughnessAt(double i) {
  return kSmoothest * std::pow(kRoughest / kSmoothest, i / kRoughnesses);
}

// The pixel averages the lobe: its width and the normals' spread and error add up (facets' slopes
// have a variance of about m^2 / 2 per axis).
std::vector<double> lobesOf(const std::vector<HighlightSample>& highlights,
                            const Eigen::Vector3f& light, double m) {
  std::vector<double> lobes;
  for (const HighlightSample& h : highlights) {
    const double wide =
        std::sqrt(m * m + 2.0 * (h.spread * h.spread + kNormalError * kNormalError));
    lobes.push_back(torranceSparrow(h.at.normal, light, h.at.view, static_cast<float>(wide)));
  }
  return lobes;
}

struct Found : SeenGloss {
  double cost = 0.0;
};

// Where the parabola through three equally spaced values has its least, in steps from the middle.
double leastOf(double before, double middle, double after) {
  const double bend = before - 2.0 * middle + after;
  return bend > 0.0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0.0;
}

// The first of the costs' dips within `limit`: a broad lobe explains errors of the diffuse shading,
// too, so that where a narrower one does as well that is the highlight. @param least of the costs
std::size_t smoothestDip(const std::vector<double>& costs, std::size_t least, double limit) {
  for (std::size_t i = 1; i < least; ++i) {
    if (costs[i] <= limit && costs[i] < costs[i - 1] && costs[i] <= costs[i + 1]) return i;
  }
  return least;
}

// The best of the roughnesses below `limit`, and which others explain the rows as well. @param most
// error that it may leave
// @param worst out: the worst error that any leaves
std::optional<Found> bestRoughness(const std::vector<Row>& rows,
                                   const std::vector<HighlightSample>& highlights,
                                   const Eigen::Vector3f& light, int clusters,
                                   const std::vector<double>* broad, double limit, double most,
                                   double& worst) {
  const auto at = [&](double i) {
    const std::vector<double> own = lobesOf(highlights, light, roughnessAt(i));
    return solve(rows, {&own, broad}, clusters);
  };
  int count = 0;
  while (count <= kRoughnesses && roughnessAt(count) < limit) ++count;
  std::vector<Solution> solutions(count);
#pragma omp parallel for schedule(dynamic, 1)
  for (int i = 0; i < count; ++i) solutions[i] = at(i);
  std::vector<double> costs;
  for (const Solution& s : solutions) {
    costs.push_back(s.strength > 0.0 ? s.cost : 1e30);
    worst = std::max(worst, s.cost);
  }
  const std::size_t least = std::min_element(costs.begin(), costs.end()) - costs.begin();
  if (costs.empty() || costs[least] >= most) return std::nullopt;
  const auto limitOf = [&](double errors) {
    return costs[least] * (1.0 + errors / weightOf(rows));
  };
  const std::size_t best = smoothestDip(costs, least, limitOf(kAlike));
  const auto lastWithin = [&](double cost) {
    std::size_t last = best;
    while (last + 1 < costs.size() && costs[last + 1] <= cost) ++last;
    return last;
  };
  std::size_t first = best;
  while (first > 0 && costs[first - 1] <= limitOf(kAlike)) --first;
  const std::size_t last = lastWithin(limitOf(kAlike));
  double exact = static_cast<double>(best);
  if (best == 0)
    exact = 0.5 * static_cast<double>(lastWithin(limitOf(kSame)));
  else if (best + 1 < costs.size())
    exact += leastOf(costs[best - 1], costs[best], costs[best + 1]);
  const float ks = static_cast<float>(at(exact).strength);
  Found found;
  found.gloss = {ks, static_cast<float>(roughnessAt(exact)), ks};
  found.smoothest = static_cast<float>(roughnessAt(first) / kModelError);
  found.roughest = static_cast<float>(roughnessAt(last) * kModelError);
  found.cost = costs[best];
  return found;
}

// The least error that any roughness leaves under the same light from direction l.
double leastError(const std::vector<HighlightSample>& highlights, LightFit fit,
                  const SunVisible& visible, const Eigen::Vector3f& l) {
  fit.light.direction = l;
  std::vector<Row> rows;
  for (const HighlightSample& h : highlights) rows.push_back(rowOf(h.at, fit, visible));
  double least = 1e30;
  for (int i = 0; i <= kRoughnesses; i += kTriedStep) {
    const std::vector<double> lobes = lobesOf(highlights, l, roughnessAt(i));
    const int clusters = static_cast<int>(fit.albedos.size());
    least = std::min(least, solve(rows, {&lobes, nullptr}, clusters).cost);
  }
  return least;
}

// Empty if all are.
std::vector<HighlightSample> inFirstPicture(const std::vector<HighlightSample>& highlights) {
  std::vector<HighlightSample> first;
  std::copy_if(highlights.begin(), highlights.end(), std::back_inserter(first),
               [](const HighlightSample& h) { return h.at.picture == 0; });
  return first.size() < highlights.size() ? first : std::vector<HighlightSample>();
}

}  // namespace

std::optional<SeenGloss> fitGloss(const std::vector<HighlightSample>& highlights,
                                  const LightFit& fit, const SunVisible& visible) {
  if (highlights.size() < kFewest) return std::nullopt;
  const Light& light = fit.light;
  std::vector<Row> rows;
  for (const HighlightSample& h : highlights) rows.push_back(rowOf(h.at, fit, visible));
  balance(highlights, light.direction, rows);
  const int clusters = static_cast<int>(fit.albedos.size());
  const double without = solve(rows, {}, clusters).cost;
  double worst = 0.0;
  const std::optional<Found> best =
      bestRoughness(rows, highlights, light.direction, clusters, nullptr, 2.0 * kRoughest,
                    kExplained * without, worst);
  if (!best || best->cost >= kSharp * worst) return std::nullopt;
  if (best->gloss.roughness < kBroad) return *best;
  // A lobe nearly as broad as diffuse shading explains that one's errors too. Where beside it a
  // narrow one is seen, that is the gloss.
  const std::vector<double> beside = lobesOf(highlights, light.direction, best->gloss.roughness);
  const double with_broad =
      solve(rows, {nullptr, &beside}, clusters).cost * (1.0 - kSeenBeside / weightOf(rows));
  const std::optional<Found> narrow =
      bestRoughness(rows, highlights, light.direction, clusters, &beside,
                    kNarrowPart * best->gloss.roughness, with_broad, worst);
  return *(narrow ? narrow : best);
}

bool tellDirection(const std::vector<HighlightSample>& highlights, const LightFit& fit,
                   const SunVisible& visible) {
  std::vector<HighlightSample> some;
  const std::size_t step = std::max<std::size_t>(1, highlights.size() / kTriedWith);
  for (std::size_t i = 0; i < highlights.size(); i += step) some.push_back(highlights[i]);
  const Eigen::Vector3f l = fit.light.direction, s = l.unitOrthogonal(), t = l.cross(s);
  std::array<double, kBesides + 1> errors;  // the last one: of the direction itself
#pragma omp parallel for schedule(dynamic, 1)
  for (int i = 0; i <= kBesides; ++i) {
    const float a = 2.0f * static_cast<float>(M_PI) * i / kBesides;
    const Eigen::Vector3f off = std::cos(a) * s + std::sin(a) * t;
    const Eigen::Vector3f beside = std::cos(kBeside) * l + std::sin(kBeside) * off;
    errors[i] = leastError(some, fit, visible, i < kBesides ? beside : l);
  }
  return *std::min_element(errors.begin(), errors.end()) >= errors.back();
}

SeenGlosses seenGlosses(const std::vector<HighlightSample>& highlights, std::size_t objects,
                        const LightFit& fit, const SunVisible& visible) {
  SeenGlosses seen{std::nullopt, std::vector<std::optional<SeenGloss>>(objects)};
  // The models are fitted to the first picture; elsewhere a pose that is a little off leads
  // highlights astray.
  for (const std::vector<HighlightSample>& some : {highlights, inFirstPicture(highlights)}) {
    if (seen.of_all || some.empty()) break;
    seen.of_all = fitGloss(some, fit, visible);
    if (seen.of_all) seen.of_all->tells_direction = tellDirection(some, fit, visible);
  }
  if (objects < 2) return seen;
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t i = 0; i < objects; ++i) {
    std::vector<HighlightSample> own;
    std::copy_if(highlights.begin(), highlights.end(), std::back_inserter(own),
                 [&](const HighlightSample& h) { return h.object == i; });
    const std::optional<SeenGloss> its = fitGloss(own, fit, visible);
    if (its && !(seen.of_all && its->leaves(seen.of_all->gloss.roughness))) seen.of_one[i] = its;
  }
  return seen;
}

float surroundingsStrength(const LightEvidence& evidence, const LightFit& fit) {
  std::vector<Row> rows;
  std::vector<double> lobes;
  for (const LightSample& s : evidence.samples) {
    rows.push_back(rowOf(s, fit, evidence.visible));
    lobes.push_back(torranceSparrow(s.normal, fit.light.direction, s.view, fit.gloss.roughness));
  }
  // The slot of the broad lobe without a lobe: the surroundings alone.
  const std::vector<double> no_lobe(rows.size(), 0.0);
  const int clusters = static_cast<int>(fit.albedos.size());
  const Solution together = solve(rows, {&lobes, nullptr}, clusters),
                 apart = solve(rows, {&lobes, &no_lobe}, clusters);
  const double found = apart.cost < together.cost ? apart.beside : together.strength;
  return static_cast<float>(std::min<double>(found, kMostAround));
}

}  // namespace calipso::render

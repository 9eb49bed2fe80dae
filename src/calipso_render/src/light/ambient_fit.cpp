#include "light/ambient_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace calipso::render {
namespace {

constexpr int kTerms = 8;            // harmonics of bands 1 and 2
constexpr int kFolds = 4;            // strips of a single picture
constexpr std::size_t kStrips = 16;  // dealt out to the folds in turn
constexpr int kRounds = 6;           // albedos and harmonics in turn
constexpr double kPrior = 0.01;      // weight of the light as it was, as a part of all samples
constexpr double kRobust = 0.15;     // relative residual beyond which a sample counts less
// of the other light's error on all that was held out: less must remain
constexpr double kBetter = 0.97;
constexpr std::size_t kFewest = 200;

using Terms = Eigen::Matrix<double, kTerms, 1>;

// What a sample says: I = a (E + sum_j A_j B_j) + G, with E of sun and band 0, G the highlight.
struct Row {
  Terms basis;                 // B: of what it sees of the sky
  Eigen::Array3d fixed, rest;  // E; I - G
  double scale;                // of the residual
  int cluster, fold;
};

using Ambient = std::array<Terms, 3>;  // per channel

class Fit {
 public:
  Fit(const std::vector<Row>& rows, int clusters, const Ambient& start)
      : rows_(rows), clusters_(clusters), start_(start) {}

  // @param without fold that is left out; -1: none
  Ambient solve(int without) const {
    Ambient ambient = start_;
    for (int round = 0; round < kRounds; ++round) {
      const std::vector<Eigen::Array3d> albedos = albedosUnder(ambient, without);
      for (int c = 0; c < 3; ++c) ambient[c] = harmonics(c, ambient, albedos, without);
    }
    return ambient;
  }

  // Robust error of the samples of one fold, their albedos known from the others.
  double heldOut(const Ambient& ambient, int fold) const {
    const std::vector<Eigen::Array3d> albedos = albedosUnder(ambient, fold);
    double sum = 0.0;
    for (const Row& r : rows_) {
      if (r.fold == fold) sum += lossOf(residual(r, ambient, albedos[r.cluster]).square().sum());
    }
    return sum;
  }

 private:
  static Eigen::Array3d lightOn(const Row& r, const Ambient& a) {
    return r.fixed + Eigen::Array3d(a[0].dot(r.basis), a[1].dot(r.basis), a[2].dot(r.basis));
  }
  static Eigen::Array3d residual(const Row& r, const Ambient& a, const Eigen::Array3d& albedo) {
    return (albedo * lightOn(r, a) - r.rest) / r.scale;
  }
  static double lossOf(double squared) {
    return 2.0 * kRobust * kRobust * (std::sqrt(1.0 + squared / (kRobust * kRobust)) - 1.0);
  }
  static double weightOf(double squared) {
    return 1.0 / std::sqrt(1.0 + squared / (kRobust * kRobust));
  }

  // Best albedo per cluster, reweighted once.
  std::vector<Eigen::Array3d> albedosUnder(const Ambient& ambient, int without) const {
    std::vector<Eigen::Array3d> albedos(clusters_, Eigen::Array3d::Zero());
    for (int pass = 0; pass < 2; ++pass) {
      std::vector<Eigen::Array3d> top(clusters_, Eigen::Array3d::Zero()),
          bottom(clusters_, Eigen::Array3d::Constant(1e-9));
      for (const Row& r : rows_) {
        if (r.fold == without) continue;
        const double weight =
            pass == 0 ? 1.0 : weightOf(residual(r, ambient, albedos[r.cluster]).square().sum());
        const Eigen::Array3d light = lightOn(r, ambient);
        top[r.cluster] += weight * light * r.rest, bottom[r.cluster] += weight * light.square();
      }
      for (int k = 0; k < clusters_; ++k) albedos[k] = (top[k] / bottom[k]).max(0.0);
    }
    return albedos;
  }

  Terms harmonics(int c, const Ambient& ambient, const std::vector<Eigen::Array3d>& albedos,
                  int without) const {
    Eigen::Matrix<double, kTerms, kTerms> left = Eigen::Matrix<double, kTerms, kTerms>::Zero();
    Terms right = Terms::Zero();
    double size = 0.0;
    for (const Row& r : rows_) {
      if (r.fold == without) continue;
      const double factor = albedos[r.cluster][c] / r.scale,
                   weight = weightOf(residual(r, ambient, albedos[r.cluster]).square().sum());
      const Terms row = factor * r.basis;
      left += weight * row * row.transpose();
      right += weight * row * (r.rest[c] / r.scale - factor * r.fixed[c]);
      size += weight * factor * factor;
    }
    left.diagonal().array() += kPrior * size;
    return left.ldlt().solve(right + kPrior * size * start_[c]);
  }

  const std::vector<Row>& rows_;
  int clusters_;
  const Ambient& start_;
};

std::vector<Row> rowsOf(const LightEvidence& evidence, const LightFit& fit) {
  std::vector<Row> rows;
  const bool one_picture = std::all_of(evidence.samples.begin(), evidence.samples.end(),
                                       [](const LightSample& s) { return s.picture == 0; });
  Light plain = fit.light;
  std::fill(plain.ambient.begin() + 1, plain.ambient.end(), cv::Vec3f());
  for (std::size_t i = 0; i < evidence.samples.size(); ++i) {
    const LightSample& s = evidence.samples[i];
    const float visible = evidence.visible ? evidence.visible(s, plain.direction) : 1.0f;
    const cv::Vec3f lit = diffuseShading(plain, s.normal, visible, s.seen,
                                         cv::Vec3f::all(kThrownBack)),
                    gloss = specularShading(fit.light, fit.gloss, s.normal, s.view, visible,
                                            skyMirrored(s.seen, mirroredIn(s.normal, s.view)));
    const Eigen::Vector3f first = s.seen.towards + kThrownBack * s.seen.thrown_towards;
    const std::array<float, 9> basis = shBasis(s.seen.towards.normalized());
    Row row;
    row.basis << first.y(), first.z(), first.x(), Eigen::Matrix<double, kTerms - 3, 1>::Zero();
    for (int j = 3; j < kTerms; ++j) row.basis[j] = s.seen.open * basis[j + 1];
    for (int c = 0; c < 3; ++c) row.fixed[c] = lit[c], row.rest[c] = s.radiance[c] - gloss[c];
    const cv::Vec3f& a = fit.albedos[s.cluster];
    row.scale = (a[0] * lit[0] + a[1] * lit[1] + a[2] * lit[2]) / 3.0 + 1e-3;
    row.cluster = s.cluster;
    row.fold =
        one_picture ? static_cast<int>(kStrips * i / evidence.samples.size()) % kFolds : s.picture;
    rows.push_back(row);
  }
  return rows;
}

}  // namespace

bool refineAmbient(const LightEvidence& evidence, LightFit& fit) {
  if (!fit.determined || evidence.samples.size() < kFewest) return false;
  const std::vector<Row> rows = rowsOf(evidence, fit);
  Ambient start;
  for (int c = 0; c < 3; ++c) {
    for (int j = 0; j < kTerms; ++j) start[c][j] = fit.light.ambient[j + 1][c];
  }
  const Fit solver(rows, evidence.clusters, start);
  const int folds = 1 + std::max_element(rows.begin(), rows.end(), [](const Row& a, const Row& b) {
                          return a.fold < b.fold;
                        })->fold;
  double before = 0.0, after = 0.0;
  for (int fold = 0; fold < folds; ++fold) {
    const double with_start = solver.heldOut(start, fold),
                 with_more = solver.heldOut(solver.solve(fold), fold);
    if (with_more > with_start) return false;
    before += with_start, after += with_more;
  }
  if (!(after < kBetter * before)) return false;
  const Ambient ambient = solver.solve(-1);
  for (int c = 0; c < 3; ++c) {
    for (int j = 0; j < kTerms; ++j)
      fit.light.ambient[j + 1][c] = static_cast<float>(ambient[c][j]);
  }
  return true;
}

}  // namespace calipso::render

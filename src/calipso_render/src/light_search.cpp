#include "light_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace calipso::render {
namespace {

constexpr int kDirections = 400;     // tried over the upper hemisphere
constexpr float kApart = 0.94f;      // cosine of the angle between two candidates
constexpr float kLowestSun = 0.08f;  // sine of its elevation

// Evenly spread over the sphere (Fibonacci), those above the horizon.
std::vector<Eigen::Vector3f> candidateDirections(const Eigen::Vector3f& up) {
  std::vector<Eigen::Vector3f> directions;
  for (int i = 0; i < kDirections * 2; ++i) {
    const float z = 1.0f - (2 * i + 1.0f) / (2 * kDirections), r = std::sqrt(1.0f - z * z), a = i * 2.39996323f;
    const Eigen::Vector3f d(r * std::cos(a), r * std::sin(a), z);
    if (d.dot(up) > kLowestSun) directions.push_back(d);
  }
  return directions;
}

// Sums of one cluster's channel for the line I = x + y max(0, n.l).
struct LineSums {
  double n = 0, s = 0, ss = 0, i = 0, si = 0, ii = 0;
};

struct Line {
  double ambient, sun, error;
};

// Least squares with both parts kept positive.
Line fitLine(const LineSums& m) {
  const double determinant = m.n * m.ss - m.s * m.s;
  double sun = determinant > 1e-9 ? (m.n * m.si - m.s * m.i) / determinant : 0.0;
  double ambient = (m.i - sun * m.s) / m.n;
  if (sun < 0.0) sun = 0.0, ambient = m.i / m.n;
  if (ambient < 0.0) ambient = 0.0, sun = m.ss > 0.0 ? m.si / m.ss : 0.0;
  const double error = m.ii - 2.0 * (ambient * m.i + sun * m.si) + ambient * ambient * m.n +
                       2.0 * ambient * sun * m.s + sun * sun * m.ss;
  return {ambient, sun, error};
}

// One straight line per cluster and channel; the errors count relative to the cluster's brightness.
LightCandidate evaluate(const std::vector<LightSample>& samples, int clusters, const Eigen::Vector3f& l, const Eigen::Vector3f& up) {
  std::vector<std::array<LineSums, 3>> sums(clusters);
  for (const LightSample& x : samples) {
    const double diffuse = std::max(0.0f, x.normal.dot(l));
    for (int c = 0; c < 3; ++c) {
      LineSums& m = sums[x.cluster][c];
      // Divided by the ambient light's assumed profile, a sample obeys the plain line.
      const double profile = 1.0 + kSkyGradient * x.normal.dot(up);
      const double i = x.radiance[c] / profile, s = diffuse / profile;
      m.n += 1, m.s += s, m.ss += s * s, m.i += i, m.si += s * i, m.ii += i * i;
    }
  }
  cv::Vec3d ambient, sun;
  LightCandidate total;
  total.direction = l;
  for (const auto& cluster : sums) {
    for (int c = 0; c < 3; ++c) {
      if (cluster[c].n < 8) continue;
      const Line line = fitLine(cluster[c]);
      const double mean = cluster[c].i / cluster[c].n + 1e-4;
      total.error += line.error / (mean * mean);
      ambient[c] += cluster[c].n * line.ambient / mean;
      sun[c] += cluster[c].n * line.sun / mean;
    }
  }
  for (int c = 0; c < 3; ++c) {
    const double sum = std::max(ambient[c] + sun[c], 1e-9);
    total.ambient[c] = static_cast<float>(std::max(0.1, ambient[c] / sum));
    total.sun[c] = static_cast<float>(std::max(0.05, sun[c] / sum));
  }
  return total;
}

}  // namespace

std::vector<LightCandidate> searchLight(const std::vector<LightSample>& samples, int clusters, const Eigen::Vector3f& up,
                                        std::size_t count) {
  std::vector<LightCandidate> all, best;
  for (const Eigen::Vector3f& l : candidateDirections(up)) all.push_back(evaluate(samples, clusters, l, up));
  std::stable_sort(all.begin(), all.end(), [](const LightCandidate& a, const LightCandidate& b) { return a.error < b.error; });
  for (const LightCandidate& candidate : all) {
    const bool apart = std::all_of(best.begin(), best.end(), [&](const LightCandidate& b) { return b.direction.dot(candidate.direction) < kApart; });
    if (apart) best.push_back(candidate);
    if (best.size() == count) break;
  }
  return best;
}

}  // namespace calipso::render

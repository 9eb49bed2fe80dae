#include "calipso_render/light_fit.hpp"

#include <algorithm>
#include <cmath>

namespace calipso::render {
namespace {

constexpr int kDirections = 400;     // tried over the upper hemisphere
constexpr int kFewestSamples = 60;
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

struct Candidate {
  double error = 0.0;
  cv::Vec3d ambient, sun;        // weighted over the clusters, of the cluster's mean radiance
};

// One straight line per cluster and channel; the errors count relative to the cluster's brightness.
Candidate evaluate(const std::vector<LightSample>& samples, int clusters, const Eigen::Vector3f& l) {
  std::vector<std::array<LineSums, 3>> sums(clusters);
  for (const LightSample& x : samples) {
    const double s = std::max(0.0f, x.normal.dot(l));
    for (int c = 0; c < 3; ++c) {
      LineSums& m = sums[x.cluster][c];
      const double i = x.radiance[c];
      m.n += 1, m.s += s, m.ss += s * s, m.i += i, m.si += s * i, m.ii += i * i;
    }
  }
  Candidate total;
  for (const auto& cluster : sums) {
    for (int c = 0; c < 3; ++c) {
      if (cluster[c].n < 8) continue;
      const Line line = fitLine(cluster[c]);
      const double mean = cluster[c].i / cluster[c].n + 1e-4;
      total.error += line.error / (mean * mean);
      total.ambient[c] += cluster[c].n * line.ambient / mean;
      total.sun[c] += cluster[c].n * line.sun / mean;
    }
  }
  return total;
}

Light defaultLight(const Eigen::Vector3f& up, const Eigen::Vector3f& view) {
  Light light;
  light.direction = (up + 0.4f * view).normalized();
  return light;
}

}  // namespace

LightFit fitLight(const std::vector<LightSample>& samples, int clusters, const Eigen::Vector3f& up,
                  const Eigen::Vector3f& view) {
  LightFit fit;
  fit.light = defaultLight(up, view);
  if (static_cast<int>(samples.size()) < kFewestSamples) return fit;
  Candidate best;
  best.error = 1e300;
  for (const Eigen::Vector3f& l : candidateDirections(up)) {
    const Candidate candidate = evaluate(samples, clusters, l);
    if (candidate.error >= best.error) continue;
    best = candidate;
    fit.light.direction = l;
  }
  // Brightness is shared between light and albedo; the mean of ambient and sun is set to 1.
  for (int c = 0; c < 3; ++c) {
    const double total = best.ambient[c] + best.sun[c];
    fit.light.ambient[0][c] = static_cast<float>(std::max(0.1, best.ambient[c] / total));
    fit.light.sun[c] = static_cast<float>(std::max(0.0, best.sun[c] / total));
  }
  fit.residual = static_cast<float>(std::sqrt(best.error / (3.0 * samples.size())));
  fit.determined = true;
  return fit;
}

}  // namespace calipso::render

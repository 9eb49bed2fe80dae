#include "light/cluster_split.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr double kDarkest = 0.004;   // linear; added before the logarithm
constexpr double kApart = 1.1;       // of log reflectance, between the groups' means
constexpr double kExplained = 0.8;   // of the variance, by them; 0.75 of an even spread would be
constexpr std::size_t kFewest = 30;  // of a group
constexpr double kLeastPart = 0.05;  // of a cluster

// Where sorted values fall into two groups (Otsu 1979), if they do.
std::optional<double> divide(const std::vector<double>& sorted) {
  const std::size_t n = sorted.size();
  double all = 0.0, squares = 0.0;
  for (const double x : sorted) all += x, squares += x * x;
  const double variance = squares - all * all / n;
  const auto least = std::max(kFewest, static_cast<std::size_t>(kLeastPart * n));
  double below = 0.0, best = kExplained * variance;
  std::optional<double> at;
  for (std::size_t i = 0; i + least < n; ++i) {
    below += sorted[i];
    const double m = i + 1.0, low = below / m, high = (all - below) / (n - m),
                 between = m * (n - m) / n * (high - low) * (high - low);
    if (m < least || high - low < kApart || between <= best) continue;
    best = between, at = 0.5 * (sorted[i] + sorted[i + 1]);
  }
  return at;
}

}  // namespace

bool splitClusters(const LightFit& fit, LightEvidence& evidence) {
  std::vector<double> reflectances;
  for (const LightSample& s : evidence.samples) {
    const float visible = evidence.visible ? evidence.visible(s, fit.light.direction) : 1.0f;
    const cv::Vec3f light =
        diffuseShading(fit.light, s.normal, visible, s.seen, cv::Vec3f::all(kThrownBack));
    reflectances.push_back(std::log((luminance(s.radiance) + kDarkest) / luminance(light)));
  }
  const int before = evidence.clusters;
  for (int k = 0; k < evidence.clusters;) {
    std::vector<double> values;
    for (std::size_t i = 0; i < reflectances.size(); ++i)
      if (evidence.samples[i].cluster == k) values.push_back(reflectances[i]);
    std::sort(values.begin(), values.end());
    if (const std::optional<double> at = divide(values)) {
      for (std::size_t i = 0; i < reflectances.size(); ++i) {
        int& cluster = evidence.samples[i].cluster;
        if (cluster == k && reflectances[i] > *at) cluster = evidence.clusters;
      }
      ++evidence.clusters;  // either group may be two
    } else {
      ++k;
    }
  }
  return evidence.clusters > before;
}

}  // namespace calipso::render

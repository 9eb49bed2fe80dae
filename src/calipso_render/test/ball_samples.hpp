#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "calipso_render/light_fit.hpp"

namespace calipso::render::testing {

// Half a ball of one colour in known light.
inline std::vector<LightSample> ballSamples(const Eigen::Vector3f& sun) {
  std::vector<LightSample> samples;
  const Eigen::Vector3f view(0, -1, 0);
  for (int i = 0; i < 1200; ++i) {
    const float z = 1.0f - (2 * i + 1) / 1200.0f, r = std::sqrt(1.0f - z * z), a = i * 2.39996f;
    const Eigen::Vector3f n(r * std::cos(a), r * std::sin(a), z);
    if (n.dot(view) < 0.2f) continue;
    const float shade = 0.3f * (1.0f + 0.45f * n.z()) + 0.6f * std::max(0.0f, n.dot(sun));
    samples.push_back({n, n, view, cv::Vec3f(0.2f, 0.4f, 0.6f) * shade, 0, SkySeen::all(n)});
  }
  return samples;
}

// The same, glossy: it mirrors its surroundings at its rims, and a shadow tells the sun.
inline LightEvidence glossyBallWithShadow(const Eigen::Vector3f& sun) {
  LightEvidence evidence;
  evidence.samples = ballSamples(sun), evidence.clusters = 1;
  for (LightSample& s : evidence.samples)
    s.radiance += cv::Vec3f::all(0.3f * 0.02f * grazing(s.normal.dot(s.view)));
  evidence.shadow_misfit = [sun](const Eigen::Vector3f& l) {
    return -2000.0 * std::max(0.0f, l.dot(sun) - 0.99f) / 0.01;
  };
  return evidence;
}

// The ball's samples under an ambient light with these harmonics, with errors of 1 %.
inline LightEvidence ballUnder(const Light& light) {
  LightEvidence evidence;
  cv::RNG random(5);
  evidence.clusters = 1;
  for (LightSample s : ballSamples(light.direction)) {
    s.radiance = diffuseShading(light, s.normal, 1.0f).mul(cv::Vec3f(0.2f, 0.4f, 0.6f)) *
                 static_cast<float>(1.0 + random.gaussian(0.01));
    evidence.samples.push_back(s);
  }
  return evidence;
}

inline LightFit plainFit(const Light& light) {
  LightFit fit;
  fit.determined = true, fit.light = light, fit.gloss.specular = 0.0f,
  fit.albedos = {cv::Vec3f(0.2f, 0.4f, 0.6f)};
  for (int j = 4; j < 9; ++j) fit.light.ambient[j] = {};
  return fit;
}

}  // namespace calipso::render::testing

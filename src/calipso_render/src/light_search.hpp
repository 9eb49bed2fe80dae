#pragma once

#include <vector>

#include "calipso_render/light_fit.hpp"

namespace calipso::render {

// A direction of the sun with the line I = ambient + sun max(0, n.l) that fits best under it.
struct LightCandidate {
  Eigen::Vector3f direction;
  double error = 0.0;       // sum of squares, relative to each cluster's brightness
  cv::Vec3f ambient, sun;   // their sum is 1
};

// Tries directions over the whole upper hemisphere; the best ones, at least 20 degrees apart, best first.
std::vector<LightCandidate> searchLight(const std::vector<LightSample>& samples, int clusters, const Eigen::Vector3f& up,
                                        std::size_t count);

// Ambient light's assumed profile: 1 + kSkyGradient n.up.
inline constexpr float kSkyGradient = 0.45f;

}  // namespace calipso::render

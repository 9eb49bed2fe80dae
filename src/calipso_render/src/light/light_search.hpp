#pragma once

#include <vector>

#include "calipso_render/light_fit.hpp"

namespace calipso::render {

// A direction of the sun with the light I = a (ambient (1 + g n.up) + sun max(0, n.l)) that fits
// best under it; 1 - g = (1 - kSkyGradient) LightEvidence::below.
struct LightCandidate {
  Eigen::Vector3f direction;
  // minus a log-likelihood, of shading and either cast shadows or what suns usually are
  double misfit = 0.0;
  // without cast shadows: how much better the best direction is than half of all; 0: nothing tells
  double contrast = 0.0;
  cv::Vec3f ambient, sun;  // their sum is 1
};

// Tries directions over the whole upper hemisphere and those that cast shadows speak for, and
// refines the best ones; without evidence of shadows also by what suns usually are (sun_prior.hpp).
// At least 20 degrees apart at first, best first.
std::vector<LightCandidate> searchLight(const LightEvidence& evidence, const Eigen::Vector3f& up,
                                        std::size_t count);

// The light of a sun in a direction that is known.
LightCandidate lightFrom(const Eigen::Vector3f& to_sun, const LightEvidence& evidence,
                         const Eigen::Vector3f& up);

// Ambient light's assumed profile, where what lies below is grey: 1 + kSkyGradient n.up.
inline constexpr float kSkyGradient = 0.45f;

// What reaches a point of a grey object under a unit of ambient light of profile 1 + g n.up,
// even + g lean, and of a unit of sunlight by way of the object.
struct GreyLight {
  double even, lean, sun;
};
inline GreyLight greyLight(const SkySeen& seen, const Eigen::Vector3f& up,
                           const Eigen::Vector3f& to_sun) {
  return {seen.open + kThrownBack * seen.thrown,
          (seen.towards + kThrownBack * seen.thrown_towards).dot(up),
          kThrownBack * sunThrown(seen, to_sun)};
}

}  // namespace calipso::render

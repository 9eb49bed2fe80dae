#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>

namespace calipso::render {

// Distant light: a disc (the sun) and ambient light in real spherical harmonics up to second order,
// band 0 first, in the world frame. Colours are linear B, G, R, in units of the radiance that a
// white diffuse surface sends out under them (irradiance / pi).
struct Light {
  Eigen::Vector3f direction = Eigen::Vector3f::UnitZ();  // unit, towards the sun, world
  cv::Vec3f sun = {0.6f, 0.6f, 0.6f};
  std::array<cv::Vec3f, 9> ambient = {cv::Vec3f(0.4f, 0.4f, 0.4f)};  // times the basis of shBasis()
  // What surfaces mirror beyond the ambient light, bands 0 and 1: the ground as pictures show it.
  std::array<cv::Vec3f, 4> mirrored = {};
  float angular_radius = 0.02f;  // of the sun, rad
};

// Torrance-Sparrow lobe with Trowbridge and Reitz's distribution (GGX; Walter et al. 2007), whose
// highlights end as slowly as real ones: specular strength ks, roughness m. The smooth
// surroundings are mirrored with a strength of their own: highlights are clipped, and narrower than
// pixels.
struct Gloss {
  float specular = 0.0f;   // ks, reflectance at normal incidence
  float roughness = 0.4f;  // m, root mean square slope of the facets
  float around = 0.0f;     // ks of the surroundings
};

// Strength of mirrored surroundings where lit white has half of the light's unit: of what mirrors
// all that reaches it, and what is found at most: a dielectric's, of refraction 1.6.
inline constexpr float kAllAround = 0.5f;
inline constexpr float kMostAround = 0.025f;

inline constexpr float kGrazing = 14.0f;  // of grazing(), and the roughness up to which it holds
inline constexpr float kSmooth = 0.08f;

// How much more a surface mirrors at a grazing view than straight on: the rougher the less, as facets
// hide each other. Where its surroundings seem stronger than any dielectric mirrors them, the fit
// takes something else for gloss, and its roughness tells nothing of that. Nothing mirrors more than
// all that reaches it.
inline float grazingGrowth(const Gloss& gloss) {
  float growth = kGrazing;
  if (gloss.around < kMostAround)
    growth *= std::exp(-5.3f * std::max(0.0f, gloss.roughness - kSmooth));
  if ((1.0f + growth) * gloss.around <= kAllAround) return growth;
  return std::max(0.0f, kAllAround / gloss.around - 1.0f);
}

// 1, then the eight of bands 1 and 2, scaled so that band 0 is 1 (Ramamoorthi and Hanrahan 2001).
std::array<float, 9> shBasis(const Eigen::Vector3f& n);

cv::Vec3f ambientAt(const Light& light, const Eigen::Vector3f& n);

// A light whose ambient light is what surfaces mirror.
inline Light asMirrored(Light light) {
  for (int i = 0; i < 4; ++i) light.ambient[i] += light.mirrored[i];
  return light;
}

// How ambient light reaches a surface point past its own object: transfer of harmonics of bands 0
// and 1 (Sloan, Kautz and Snyder 2002), of what comes straight and of what the object throws back
// once, per unit of its reflectance.
//   open     T_0 = 1/pi int V n.w dw            towards         T_1 = 3/(2 pi) int V w n.w dw
//   thrown   R_0 = 1/pi int (1 - V) T_0' n.w dw  thrown_towards  R_1, likewise of T_1'
//   V  1 where nothing hides direction w    '  of the place that is met there
// and, for what is mirrored from single directions, V itself: V(w) = level + w.slope + w.curve w.
struct SkySeen {
  float open = 1.0f;
  Eigen::Vector3f towards = Eigen::Vector3f::Zero();
  float thrown = 0.0f;
  Eigen::Vector3f thrown_towards = Eigen::Vector3f::Zero();
  float level = 1.0f;
  Eigen::Vector3f slope = Eigen::Vector3f::Zero();
  Eigen::Matrix3f curve = Eigen::Matrix3f::Zero();

  static SkySeen all(const Eigen::Vector3f& n) {
    SkySeen seen;
    seen.towards = n;
    return seen;
  }
  static SkySeen none() {
    SkySeen seen;
    seen.open = seen.level = 0.0f;
    return seen;
  }
  SkySeen turned(const Eigen::Matrix3f& by) const {
    if (open == 1.0f) return all(by * towards);
    return {open,
            by * towards,
            thrown,
            by * thrown_towards,
            level,
            by * slope,
            by * curve * by.transpose()};
  }
  // Linear in everything.
  SkySeen operator*(float s) const {
    return {s * open, s * towards, s * thrown, s * thrown_towards, s * level, s * slope, s * curve};
  }
  SkySeen operator+(const SkySeen& b) const {
    return {
        open + b.open,   towards + b.towards, thrown + b.thrown, thrown_towards + b.thrown_towards,
        level + b.level, slope + b.slope,     curve + b.curve};
  }
  // V in unit direction w.
  float openTowards(const Eigen::Vector3f& w) const {
    return std::clamp(level + w.dot(slope + curve * w), 0.0f, 1.0f);
  }
};

// Reflectance that an object throws light back with whose colour is not known.
inline constexpr float kThrownBack = 0.3f;

// The same of that brightness, in the colour of a known reflectance.
cv::Vec3f thrownBack(const cv::Vec3f& reflectance);

// Direction that a surface with unit normal n mirrors to unit direction `view`.
inline Eigen::Vector3f mirroredIn(const Eigen::Vector3f& n, const Eigen::Vector3f& view) {
  return 2.0f * n.dot(view) * n - view;
}

// Part of the sky that a surface mirrors from unit direction w; where its object hides it, what
// that throws back for it. @param lit part of the light from there that shade leaves
inline float skyMirrored(const SkySeen& seen, const Eigen::Vector3f& w, float lit = 1.0f) {
  constexpr float kNone = 1e-3f;
  const float open = seen.openTowards(w), hidden = 1.0f - seen.open;
  const float back = hidden > kNone ? seen.thrown / hidden : 0.0f;
  return open * lit + (1.0f - open) * kThrownBack * std::min(1.0f, back);
}

// Part of the sun's light that reaches a point by way of its object, per unit of reflectance: by
// the sun's own harmonics of bands 0 and 1 over the hemisphere.
inline float sunThrown(const SkySeen& seen, const Eigen::Vector3f& to_sun) {
  return std::max(0.0f, 0.25f * seen.thrown + 0.5f * seen.thrown_towards.dot(to_sun));
}

// What reaches a surface point without the sun. @param thrown_back reflectance of its object
cv::Vec3f ambientOn(const Light& light, const SkySeen& seen, const cv::Vec3f& thrown_back);

// Radiance of a white diffuse surface with unit normal n; `sun`: visible fraction of it.
cv::Vec3f diffuseShading(const Light& light, const Eigen::Vector3f& n, float sun,
                         const SkySeen& seen, const cv::Vec3f& thrown_back);

// The same where nothing hides the sky.
cv::Vec3f diffuseShading(const Light& light, const Eigen::Vector3f& n, float sun);

// D G / (4 n.v) of Torrance and Sparrow 1967 with unit ks, Trowbridge and Reitz's D times pi (the
// light's colour is irradiance / pi). Zero where light or viewer are below the horizon. l, v: unit,
// towards light, viewer.
float torranceSparrow(const Eigen::Vector3f& n, const Eigen::Vector3f& l, const Eigen::Vector3f& v,
                      float m);

// The same with its derivatives. The derivative to l holds for l on the unit sphere.
struct Lobe {
  double value = 0.0;
  Eigen::Vector3d by_light = Eigen::Vector3d::Zero();
  double by_roughness = 0.0;
};
Lobe torranceSparrowLobe(const Eigen::Vector3d& n, const Eigen::Vector3d& l,
                         const Eigen::Vector3d& v, double m);

// The same at any view (Schlick 1994), relative to normal incidence. Fits, which see no grazing
// views, take it as constant.
inline float grazing(float n_v, float growth = kGrazing) {
  const float rest = 1.0f - std::clamp(n_v, 0.0f, 1.0f), squared = rest * rest;
  return 1.0f + growth * (squared * squared * rest);
}

// Radiance of the gloss: ks times the lobe times the visible sun, and the mirrored surroundings.
// @param sun, sky visible fraction of each
cv::Vec3f specularShading(const Light& light, const Gloss& gloss, const Eigen::Vector3f& n,
                          const Eigen::Vector3f& view, float sun, float sky = 1.0f);

}  // namespace calipso::render

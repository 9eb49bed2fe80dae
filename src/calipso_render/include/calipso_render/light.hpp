#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <opencv2/core.hpp>

namespace calipso::render {

// Distant light: a disc (the sun) and ambient light in real spherical harmonics up to second order,
// band 0 first, in the world frame. Colours are linear B, G, R, in units of the radiance that a
// white diffuse surface sends out under them (irradiance / pi).
struct Light {
  Eigen::Vector3f direction = Eigen::Vector3f::UnitZ();  // unit, towards the sun, world
  cv::Vec3f sun = {0.6f, 0.6f, 0.6f};
  std::array<cv::Vec3f, 9> ambient = {cv::Vec3f(0.4f, 0.4f, 0.4f)};  // times the basis of shBasis()
  float angular_radius = 0.02f;                                      // of the sun, rad
};

// Torrance-Sparrow lobe with Beckmann's distribution: specular strength ks, roughness m.
struct Gloss {
  float specular = 0.0f;   // ks, reflectance at normal incidence
  float roughness = 0.4f;  // m, root mean square slope of the facets
};

inline constexpr float kGrazing = 14.0f;  // of grazing()

// 1, then the eight of bands 1 and 2, scaled so that band 0 is 1 (Ramamoorthi and Hanrahan 2001).
std::array<float, 9> shBasis(const Eigen::Vector3f& n);

cv::Vec3f ambientAt(const Light& light, const Eigen::Vector3f& n);

// Part of the hidden sky's light that comes back from what hides it; `sky` below, where it is a
// surface's own, has that in it.
inline constexpr float kThrownBack = 0.3f;

// The colour of what comes back: per channel, what is added to each unit of 1 - sky where the
// surface that hides the sky has this reflectance. 0 where it is grey.
cv::Vec3f thrownBackTint(const cv::Vec3f& reflectance);

// Radiance of a white diffuse surface with unit normal n; `sun`, `sky`: visible fraction of each;
// `tint`: see thrownBackTint().
cv::Vec3f diffuseShading(const Light& light, const Eigen::Vector3f& n, float sun, float sky = 1.0f,
                         const cv::Vec3f& tint = {});

// D G / (4 n.v) of Torrance and Sparrow 1967 with unit ks, Beckmann's D times pi (the light's
// colour is irradiance / pi). Zero where light or viewer are below the horizon. l, v: unit, towards
// light, viewer.
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

// How much more a surface mirrors at a grazing view (Schlick 1994), relative to normal incidence.
// One minus the roughness that a rough surface keeps of it is taken as constant: the surroundings
// are smooth.
inline float grazing(float n_v) {
  const float rest = 1.0f - std::clamp(n_v, 0.0f, 1.0f), squared = rest * rest;
  return 1.0f + kGrazing * squared * squared * rest;
}

// Radiance of the gloss: ks times the lobe times the visible sun, and the mirrored surroundings.
// @param sun, sky visible fraction of each
cv::Vec3f specularShading(const Light& light, const Gloss& gloss, const Eigen::Vector3f& n,
                          const Eigen::Vector3f& view, float sun, float sky = 1.0f);

}  // namespace calipso::render

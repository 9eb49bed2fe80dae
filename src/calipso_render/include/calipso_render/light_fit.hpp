#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/light.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/stage.hpp"

namespace calipso::render {

// What one pixel says about the light.
struct LightSample {
  Eigen::Vector3f position, normal, view;  // world; view: unit, towards the camera
  cv::Vec3f radiance;                      // linear
  int cluster = 0;                         // pixels of one cluster share an albedo
};

// Pixels of the objects away from rims and from saturation, clustered by chromaticity per object.
// @param picture CV_32FC3, code values; @param clusters out: number of clusters
std::vector<LightSample> lightSamples(const std::vector<Actor>& actors, const cv::Mat& picture, const cv::Mat& labels,
                                      const Camera& camera, int& clusters);

struct LightFit {
  Light light;
  Gloss gloss;                     // of all objects together
  std::vector<cv::Vec3f> albedos;  // per cluster, up to a common factor
  bool determined = false;         // false: too little was seen; the light is a default, high and frontal
  double cost = 0.0;               // of the last pass, half the robust sum of squares
};

// Sun direction, sun and ambient colour, albedos and gloss from shading: a search over directions, then
// four passes (light, diffuse, specular, roughness) and one with everything free, from each of the best
// directions (paper: section 6). The objects shade themselves and each other.
// @param up unit vector against gravity: the sun is not below the horizon
// @param view unit vector towards the camera, for the default
LightFit fitLight(const std::vector<LightSample>& samples, int clusters, const std::vector<Occluder>& occluders,
                  const Eigen::Vector3f& up, const Eigen::Vector3f& view);

}  // namespace calipso::render

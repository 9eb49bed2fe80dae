#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/light.hpp"
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
  std::vector<cv::Vec3f> albedos;  // per cluster, up to a common factor
  bool determined = false;         // false: too little was seen; the light is a default, high and frontal
  float residual = 0.0f;           // root mean square, relative to the mean radiance
};

// Sun direction, sun and ambient colour from shading.
// @param up unit vector against gravity: the sun is not below the horizon
LightFit fitLight(const std::vector<LightSample>& samples, int clusters, const Eigen::Vector3f& up,
                  const Eigen::Vector3f& view);

}  // namespace calipso::render

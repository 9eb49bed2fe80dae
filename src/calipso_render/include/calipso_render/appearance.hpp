#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/light.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/stage.hpp"

namespace calipso::render {

// An object's reflectance as a picture: the key frame, its highlights taken off, divided by the light
// that fell on the surface there. A surface point is coloured by the pixel in which the key frame's
// camera saw it, so that what is drawn where it was seen is the key frame again. A point that was not
// seen takes the reflectance of the surface in front of it: continuous at the silhouette.
class Appearance {
 public:
  // Pixel-wise reflectance (linear; CV_32FC3), extended beyond the silhouette.
  cv::Mat albedo;
  cv::Rect region;       // of the key frame's picture that albedo covers
  cv::Mat key_nearness;  // CV_32FC1 over region: 1/depth of the object's front at the key frame, 0 = none
  Camera key_camera;
  cv::Vec3f mean_light;  // average shading over the seen surface: regularises the relighting
  Gloss gloss;

  // Linear radiance of the point under diffuse shading `now` with highlight `highlight` at its place.
  cv::Vec3f radiance(const SurfacePoint& point, const cv::Vec3f& now, const cv::Vec3f& highlight) const;

  // Linear reflectance of a surface point given at the key frame.
  cv::Vec3f albedoAt(const Eigen::Vector3f& key_position) const;
};

// Keeps relighting finite where the key frame's light was weak: albedo = I / (S + floor).
inline cv::Vec3f lightFloor(const cv::Vec3f& mean_light) { return mean_light * 0.05f; }

// @param key all objects at the key frame; @param picture CV_32FC3, code values
// @param labels CV_8UC1 key frame; @param sun shadows at the key frame
std::vector<Appearance> makeAppearances(const std::vector<Actor>& key, const cv::Mat& picture, const cv::Mat& labels,
                                        const Camera& camera, const Light& light, const Gloss& gloss,
                                        const ShadowMap& sun);

// Bicubic (Catmull-Rom) lookup with borders repeated. (u, v) in the image's own pixels.
cv::Vec3f sampleBicubic(const cv::Mat& image, float u, float v);

}  // namespace calipso::render

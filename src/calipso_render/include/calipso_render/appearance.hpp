#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/light.hpp"
#include "calipso_render/stage.hpp"
#include "calipso_render/surface_texture.hpp"
#include "calipso_render/unseen_shade.hpp"

namespace calipso::render {

// An object's reflectance: a picture, the key frame with its highlights taken off divided by the
// light that fell on the surface there, and a texture on the mesh. What the key frame's camera saw
// takes its colour from the picture, so that drawn there it is the key frame again; the rest takes
// it from the texture: from further frames, from like places, from the pattern that is all over the
// object, or smoothly from the surface around it.
class Appearance {
 public:
  enum class Source : std::uint8_t { kPicture, kTexture, kBoth };

  // Pixel-wise reflectance (linear; CV_32FC4, the fourth unused), extended beyond the silhouette.
  cv::Mat albedo;
  cv::Rect region;         // of the key frame's picture that albedo covers
  SurfaceTexture texture;  // reflectance, and how far the picture is to be taken instead (0..1)
  // per triangle: what `texture` says there; findSources() once that is complete
  std::vector<Source> sources;
  Camera key_camera;
  cv::Vec3f mean_light;  // average shading over the seen surface: regularises the relighting
  // thrownBack() of its mean reflectance
  cv::Vec3f thrown_back = {kThrownBack, kThrownBack, kThrownBack};
  Gloss gloss;
  // deviation, code values, that pixels of a place have from picture to picture; 0 unknown
  float grain = 0.0f;
  float seen_in_key = 0.0f, seen_elsewhere = 0.0f,
        copied = 0.0f;  // parts of the texture's texels; the rest is filled

  void findSources();

  // Linear radiance of reflectance `albedo_at` under diffuse shading `now` with highlight
  // `highlight` at its place.
  cv::Vec3f radiance(const cv::Vec3f& albedo_at, const cv::Vec3f& now,
                     const cv::Vec3f& highlight) const;

  // Linear reflectance of a surface point.
  cv::Vec3f albedoAt(const SurfacePoint& point) const;

 private:
  cv::Vec3f pictureAt(const Eigen::Vector3f& key_position) const;
};

// Keeps relighting finite where the key frame's light was weak: albedo = I / (S + floor).
inline cv::Vec3f lightFloor(const cv::Vec3f& mean_light) { return mean_light * 0.05f; }

// @param views the key frame, then frames in which the objects that `moves` names are seen from
// other sides; planes: those that they mirror from below; unseen: keeps the sun off them
std::vector<Appearance> makeAppearances(const std::vector<View>& views,
                                        const std::vector<bool>& moves, const Light& light,
                                        const std::vector<Gloss>& glosses,
                                        const std::vector<SupportPlane>& planes = {},
                                        const UnseenShade& unseen = {});

// Bicubic (Catmull-Rom) lookup with borders repeated, not below 0. (u, v) in the image's own
// pixels.
// @param image CV_32FC4
cv::Vec4f sampleBicubic(const cv::Mat& image, float u, float v);

}  // namespace calipso::render

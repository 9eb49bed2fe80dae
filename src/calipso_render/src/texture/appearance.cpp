#include "calipso_render/appearance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calipso_render/colour.hpp"
#include "calipso_render/inpaint.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"
#include "draw/bicubic.hpp"
#include "draw/light_batch.hpp"
#include "light/shaded_ground.hpp"
#include "place/masked_quantile.hpp"
#include "smooth_step.hpp"
#include "texture/false_shade.hpp"
#include "texture/highlight_remains.hpp"
#include "texture/mesh_topology.hpp"
#include "texture/picture_trust.hpp"
#include "texture/rim_hue.hpp"
#include "texture/texture_fill.hpp"

namespace calipso::render {
namespace {

constexpr float kMatt = 0.25f;  // part of a pixel's light that is never taken for a highlight
constexpr int kMargin = 12;     // px around the object that albedo is extended by
constexpr int kShadowMapSide = 768;
// of the mean light: what has less of it shows its reflectance with less certainty. By the second one
// at the mask's rim, where brighter surroundings mix in, and of what tells that others are too bright.
constexpr float kLit = 0.38f, kWellLit = 0.7f;
// part of a pixel's light, or of that of the object's bright ones, at which the sun's highlight begins
// to hide its reflectance, and hides it
constexpr float kGlossy = 0.2f, kAllGloss = 0.6f;
constexpr double kBright = 0.9;  // quantile of the object's brightness
constexpr float kTold = 0.9f;    // trust from which a reflectance is told
constexpr float kLeastClear = 0.02f;
constexpr float kDarkest = 1e-4f;  // linear brightness that is told from none
constexpr float kBroad = 0.35f;    // m from which a lobe looks like diffuse shading
constexpr float kJump = 0.03f;     // of the object's extent: what hides a part of it is before it
constexpr float kOnlyPicture = 0.999f, kOnlyTexture = 0.001f;  // of the texture's fourth value

// What the objects of a view leave of sun and sky.
struct Shade {
  ShadowMap sun;
  SkyMap sky;
  const std::vector<SupportPlane>* planes;
  const UnseenShade* unseen;
};

// Light on one actor's visible surface, pixel by pixel.
struct Shaded {
  cv::Mat highlight;  // CV_32FC3: specular radiance
  cv::Mat light;      // CV_32FC3: shading of a white surface; 0 where the object is not seen
  cv::Mat glint;      // CV_32FC1: brightness of the sun's part of it, of a lobe that stands out
  cv::Mat nearness;   // CV_32FC1
  cv::Mat open;       // CV_32FC3: `light` if nothing were before the surface
  cv::Mat triangle;   // CV_32SC1, -1 = none
  cv::Mat sky;        // CV_32FC1: SkySeen::open
  cv::Mat normal;     // CV_32FC3
  cv::Vec3f mean;
};

// Visible part of the sun at each point.
std::vector<float> sunAt(const std::vector<SurfacePoint>& points, const Shade& shade) {
  std::vector<float> visible;
  LightBatch batch;
  float some[LightBatch::kMost];
  for (const SurfacePoint& p : points) {
    batch.add(p.position, p.normal);
    if (batch.count() < LightBatch::kMost && &p != &points.back()) continue;
    batch.look(shade.sun, some);
    multiplyBy(*shade.unseen, batch, some);
    visible.insert(visible.end(), some, some + batch.count());
    batch.clear();
  }
  return visible;
}

Shaded lightOn(const Actor& actor, const cv::Rect& region, const Camera& camera, const Light& light,
               const Gloss& gloss, const Shade& shade, const cv::Vec3f& thrown_back) {
  Shaded s;
  const ShadedGround ground(*shade.planes, light, {&shade.sun, shade.unseen}, shade.sky);
  for (cv::Mat* colours : {&s.highlight, &s.light, &s.open, &s.normal})
    *colours = cv::Mat::zeros(region.size(), CV_32FC3);
  for (cv::Mat* values : {&s.glint, &s.nearness, &s.sky})
    *values = cv::Mat::zeros(region.size(), CV_32F);
  s.triangle = cv::Mat(region.size(), CV_32S, cv::Scalar(-1));
  const VisibilityBuffer buffer(region, {&actor.screen});
  const Eigen::Vector3f eye = camera.world_from_camera.translation().cast<float>();
  std::vector<cv::Vec3d> sums(region.height);
  std::vector<int> counts(region.height, 0);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region.height; ++v) {
    std::vector<int> columns;
    std::vector<SurfacePoint> points;
    for (int u = 0; u < region.width; ++u) {
      const std::uint32_t id = buffer.ids(v)[u];
      if (id == VisibilityBuffer::kNothing) continue;
      columns.push_back(u);
      points.push_back(
          surfacePoint(actor, VisibilityBuffer::triangleOf(id), u + region.x, v + region.y, eye));
    }
    const std::vector<float> sun = sunAt(points, shade);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const int u = columns[i];
      const SurfacePoint& p = points[i];
      const float visible = sun[i];
      const cv::Vec3f l = diffuseShading(light, p.normal, visible, p.seen, thrown_back);
      s.light.at<cv::Vec3f>(v, u) = l;
      s.open.at<cv::Vec3f>(v, u) = diffuseShading(light, p.normal, 1.0f);
      const Eigen::Vector3f towards = (eye - p.position).normalized();
      const Eigen::Vector3f mirrored = mirroredIn(p.normal, towards);
      s.highlight.at<cv::Vec3f>(v, u) =
          specularShading(light, gloss, p.normal, towards, visible,
                          skyMirrored(p.seen, mirrored, ground.lit(p.position, mirrored)));
      if (gloss.roughness < kBroad) {
        s.glint.at<float>(v, u) =
            luminance(light.sun) * gloss.specular * visible *
            torranceSparrow(p.normal, light.direction, towards, gloss.roughness);
      }
      s.nearness.at<float>(v, u) = buffer.nearness(v)[u];
      s.triangle.at<int>(v, u) = p.triangle;
      s.sky.at<float>(v, u) = p.seen.open;
      s.normal.at<cv::Vec3f>(v, u) = {p.normal.x(), p.normal.y(), p.normal.z()};
      sums[v] += cv::Vec3d(l), ++counts[v];
    }
  }
  cv::Vec3d sum;
  int count = 0;
  for (int v = 0; v < region.height; ++v) sum += sums[v], count += counts[v];
  s.mean = count > 0 ? cv::Vec3f(sum / count) : cv::Vec3f(1, 1, 1);
  return s;
}

// Part of a pixel's light, or of that of the object's bright ones, that is the sun's highlight.
// @param codes CV_32FC3 @param object CV_8UC1, 255 on it
cv::Mat lobeOf(const cv::Mat& codes, const cv::Mat& object, const cv::Mat& glint) {
  cv::Mat lobe(glint.size(), CV_32F);
  const cv::Mat brightness = luminanceOf(codes);
  const float bright = quantileOf(brightness, object, kBright);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < lobe.rows; ++v) {
    for (int u = 0; u < lobe.cols; ++u)
      lobe.at<float>(v, u) =
          glint.at<float>(v, u) / std::max({brightness.at<float>(v, u), bright, kDarkest});
  }
  return lobe;
}

// Reflectance::clear, of the least clear pixel around. A highlight hides what it outshines: of dark
// things on a bright object more is told than is lost as long as it is little against that.
cv::Mat clearOf(const cv::Mat& lobe) {
  cv::Mat clear(lobe.size(), CV_32F);
  for (int v = 0; v < clear.rows; ++v) {
    for (int u = 0; u < clear.cols; ++u)
      clear.at<float>(v, u) =
          std::max(kLeastClear, 1.0f - smoothStep(kGlossy, kAllGloss, lobe.at<float>(v, u)));
  }
  cv::erode(clear, clear, cv::Mat::ones(3, 3, CV_8U));
  return clear;
}

// @param mean_light that of the key frame, where there is one; alone no other view shows the object
Reflectance reflectanceIn(const View& view, const Actor& actor, const Light& light,
                          const Gloss& gloss, const Shade& shade,
                          const std::optional<cv::Vec3f>& mean_light, const cv::Vec3f& thrown_back,
                          bool alone) {
  Reflectance r;
  const cv::Rect all(0, 0, view.picture.cols, view.picture.rows);
  cv::Rect mask_box = cv::boundingRect(view.labels == actor.surface->index);
  mask_box =
      mask_box.empty()
          ? mask_box
          : (mask_box + cv::Size(2 * kMargin, 2 * kMargin) - cv::Point(kMargin, kMargin)) & all;
  r.region = boundsOf(actor.screen, kMargin, view.picture.size()) | mask_box;
  if (r.region.empty()) r.region = cv::Rect(0, 0, 1, 1);
  const Shaded shaded = lightOn(actor, r.region, view.camera, light, gloss, shade, thrown_back);
  r.nearness = shaded.nearness, r.normal = shaded.normal, r.triangle = shaded.triangle;
  r.open = shaded.sky;
  view.picture(r.region).convertTo(r.codes, CV_32F);
  unmixHue(view.labels(r.region) == actor.surface->index, r.codes);
  const cv::Mat lobe = lobeOf(r.codes, view.labels(r.region) == actor.surface->index, shaded.glint);
  r.clear = clearOf(lobe);
  r.mean_light = mean_light.value_or(shaded.mean);
  const cv::Vec3f floor = lightFloor(r.mean_light);
  r.trust = trustOf(view.labels, actor.surface->index, r.region);
  r.albedo = cv::Mat(r.region.size(), CV_32FC3, cv::Scalar::all(0));
  cv::Mat well_lit = cv::Mat::zeros(r.region.size(), CV_8U);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < r.region.height; ++v) {
    for (int u = 0; u < r.region.width; ++u) {
      if (r.nearness.at<float>(v, u) == 0.0f) {
        r.trust.at<float>(v, u) = 0.0f;
        continue;
      }
      const cv::Vec3f& code = r.codes.at<cv::Vec3f>(v, u);
      const cv::Vec3f& l = shaded.light.at<cv::Vec3f>(v, u);
      const cv::Vec3f& highlight = shaded.highlight.at<cv::Vec3f>(v, u);
      for (int c = 0; c < 3; ++c) {
        const float i = linearFromRealCode(code[c]);
        r.albedo.at<cv::Vec3f>(v, u)[c] = std::max(i - highlight[c], kMatt * i) / (l[c] + floor[c]);
      }
      const float part = luminance(l) / luminance(r.mean_light);
      float& trust = r.trust.at<float>(v, u);
      trust *= std::min(1.0f, part / (trust < 1.0f ? kWellLit : kLit));
      if (part > kWellLit) well_lit.at<std::uint8_t>(v, u) = 255;
    }
  }
  hideRemains(r.albedo, r.trust, lobe, r.clear);
  lowerBesideJumps(view.camera, kJump * boxOf(actor.surface->key_vertices).diagonal().norm(), r);
  if (alone) lowerAtSteps(shaded.light, shaded.open, r);
  trustDetails(view.labels, *actor.surface, r);
  takeOutFalseShade({shaded.light, shaded.open, (r.trust > kTold) & well_lit}, floor, r.albedo);
  return r;
}

Shade shadeIn(const View& view, const Light& light, const std::vector<SupportPlane>& planes,
              const UnseenShade& unseen) {
  std::vector<Occluder> occluders;
  for (const Actor& a : view.actors)
    occluders.push_back({&a.vertices, &a.surface->triangles, a.surface->winding});
  ShadowMap sun(occluders, light.direction.cast<double>(),
                {kShadowMapSide, light.angular_radius, 16});
  if (planes.empty()) occluders.clear();
  const Eigen::Vector3d up = planes.empty() ? Eigen::Vector3d::UnitZ() : planes.front().normal;
  return {std::move(sun), SkyMap(occluders, up, SkyMap::Params()), &planes, &unseen};
}

cv::Vec3f meanReflectance(const Reflectance& r) {
  const cv::Scalar mean =
      cv::countNonZero(r.trust) > 0 ? cv::mean(r.albedo, r.trust > 0.0f) : cv::Scalar();
  return {static_cast<float>(mean[0]), static_cast<float>(mean[1]), static_cast<float>(mean[2])};
}

cv::Mat widened(const cv::Mat& colour) {
  cv::Mat wide;
  cv::cvtColor(colour, wide, cv::COLOR_BGR2BGRA);
  return wide;
}

// What is sampled at the rim has some of the pixels beside it in it.
cv::Mat beyondRim(const Reflectance& r) {
  cv::Mat filled = pushPull(r.albedo, r.trust.mul(r.clear));
  r.albedo.copyTo(filled, r.nearness > 0.0f);
  return widened(filled);
}

Appearance::Source sourceOf(const SurfaceTexture& texture, int triangle) {
  bool picture = true, filled = true;
  for (std::size_t i = texture.firstOf(triangle); i < texture.firstOf(triangle + 1); ++i) {
    picture = picture && texture.texels[i][3] > kOnlyPicture,
    filled = filled && texture.texels[i][3] < kOnlyTexture;
  }
  return picture  ? Appearance::Source::kPicture
         : filled ? Appearance::Source::kTexture
                  : Appearance::Source::kBoth;
}

// One object as the views show it, the key frame's first; alone if they show it as that does.
class Portrait {
 public:
  Portrait(const std::vector<View>& views, std::size_t object, bool anew, const Light& light,
           const Gloss& gloss)
      : light_(light) {
    for (std::size_t i = 0; i < (anew ? views.size() : 1); ++i)
      views_.push_back(&views[i]), actors_.push_back(&views[i].actors[object]);
    pictures_.resize(views_.size());
    appearance_.gloss = gloss, appearance_.key_camera = views[0].camera;
  }

  void seeKey(const Shade& shade) {
    appearance_.thrown_back = thrownBack({});
    see(0, shade, std::nullopt);
    appearance_.thrown_back = thrownBack(meanReflectance(pictures_[0]));
    see(0, shade, std::nullopt);
    appearance_.mean_light = pictures_[0].mean_light, appearance_.region = pictures_[0].region;
  }

  // @param view one after the key frame's
  void seeFurther(std::size_t view, const Shade& shade) {
    if (view < views_.size()) see(view, shade, appearance_.mean_light);
  }

  Appearance finished() {
    Appearance& a = appearance_;
    // What a highlight hides is taken from around it.
    a.albedo = widened(pushPull(pictures_[0].albedo, pictures_[0].trust.mul(pictures_[0].clear)));
    pictures_[0].albedo = widened(pictures_[0].albedo);
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t i = 1; i < pictures_.size(); ++i)
      pictures_[i].albedo = beyondRim(pictures_[i]);
    fillTexture({views_, actors_, pictures_}, a);
    a.findSources();
    return std::move(a);
  }

 private:
  void see(std::size_t i, const Shade& shade, const std::optional<cv::Vec3f>& mean_light) {
    pictures_[i] = reflectanceIn(*views_[i], *actors_[i], light_, appearance_.gloss, shade,
                                 mean_light, appearance_.thrown_back, views_.size() == 1);
  }

  const Light& light_;
  std::vector<const View*> views_;
  std::vector<const Actor*> actors_;
  std::vector<Reflectance> pictures_;
  Appearance appearance_;
};

}  // namespace

std::vector<Appearance> makeAppearances(const std::vector<View>& views,
                                        const std::vector<bool>& moves, const Light& light,
                                        const std::vector<Gloss>& glosses,
                                        const std::vector<SupportPlane>& planes,
                                        const UnseenShade& unseen) {
  std::vector<Portrait> portraits;
  const std::vector<bool> anew = shownAnew(views, moves);
  for (std::size_t i = 0; i < moves.size(); ++i)
    portraits.emplace_back(views, i, anew[i], light, glosses[i]);
  const Shade key_shade = shadeIn(views[0], light, planes, unseen);
#pragma omp parallel for schedule(dynamic, 1) if (moves.size() > 1)
  for (std::size_t i = 0; i < moves.size(); ++i) portraits[i].seeKey(key_shade);
  if (std::find(anew.begin(), anew.end(), true) != anew.end()) {
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t k = 1; k < views.size(); ++k) {
      const Shade shade = shadeIn(views[k], light, planes, unseen);
      for (Portrait& p : portraits) p.seeFurther(k, shade);
    }
  }
  std::vector<Appearance> appearances(moves.size());
#pragma omp parallel for schedule(dynamic, 1) if (moves.size() > 1)
  for (std::size_t i = 0; i < moves.size(); ++i) appearances[i] = portraits[i].finished();
  return appearances;
}

void Appearance::findSources() {
  sources.clear();
  for (int t = 0; t < texture.triangleCount(); ++t) sources.push_back(sourceOf(texture, t));
}

cv::Vec3f Appearance::pictureAt(const Eigen::Vector3f& key_position) const {
  const Eigen::Vector2d q = key_camera.projectWorld(key_position.cast<double>());
  const cv::Vec4f c = sampleBicubic(albedo, static_cast<float>(q.x()) - region.x,
                                    static_cast<float>(q.y()) - region.y);
  return {c[0], c[1], c[2]};
}

cv::Vec3f Appearance::albedoAt(const SurfacePoint& point) const {
  const cv::Vec4f texel = texture.at(point.triangle, point.weights);
  if (texel[3] > kOnlyPicture) return pictureAt(point.key_position);
  const cv::Vec3f filled(texel[0], texel[1], texel[2]);
  return texel[3] < kOnlyTexture
             ? filled
             : filled * (1.0f - texel[3]) + pictureAt(point.key_position) * texel[3];
}

cv::Vec3f Appearance::radiance(const cv::Vec3f& albedo_at, const cv::Vec3f& now,
                               const cv::Vec3f& highlight) const {
  return albedo_at.mul(now + lightFloor(mean_light)) + highlight;
}

cv::Vec4f sampleBicubic(const cv::Mat& image, float u, float v) {
  cv::Vec4f value;
  cv::v_store(value.val, bicubic(image, u, v));
  return value;
}

}  // namespace calipso::render

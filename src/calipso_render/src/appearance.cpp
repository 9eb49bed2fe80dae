#include "calipso_render/appearance.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "calipso_render/colour.hpp"
#include "calipso_render/inpaint.hpp"
#include "calipso_render/shadow_map.hpp"
#include "bicubic.hpp"

namespace calipso::render {
namespace {

constexpr float kMatt = 0.25f;  // part of a pixel's light that is never taken for a highlight
constexpr int kMargin = 12;  // px around the object that albedo is extended by
constexpr int kShadowMapSide = 768;
constexpr std::size_t kMostTexels = 300000;  // per object
constexpr float kDepthTolerance = 0.012f;    // of the object's extent: a point that far behind the front is hidden
constexpr float kFlattest = 0.05f, kFull = 0.25f;  // cosine of the view from which a surface is seen, and well seen
constexpr float kEnough = 0.3f;   // weight of a look that needs no other
constexpr float kSeen = 1e-5f;    // sum of weights, cubed, below which a texel counts as not seen
constexpr float kKnown = 0.5f;  // certainty, of the greatest there is, of what others are continued from
constexpr float kSure = 0.2f;   // ... of which nothing else is needed
constexpr float kLit = 0.7f;    // of the mean light: what has less of it shows its reflectance with less certainty
constexpr float kFurther = 0.3f;  // of further frames, whose poses are less exact
constexpr float kOnlyPicture = 0.999f, kOnlyTexture = 0.001f;  // of the texture's fourth value
const cv::Vec3f kUnknown(0.3f, 0.3f, 0.3f);  // reflectance of an object that no picture shows

// Trust in a pixel as a picture of the object alone, by distance from the mask's rim (px): the first
// pixels mix with the background and with what compression spreads.
float rimTrust(float depth) {
  if (depth <= 1.0f) return 0.02f;
  return std::clamp((depth - 1.0f) / 1.5f, 0.05f, 1.0f);
}

cv::Mat trustOf(const cv::Mat& labels, int index) {
  cv::Mat padded, depth;
  cv::copyMakeBorder(labels == index, padded, 1, 1, 1, 1, cv::BORDER_REPLICATE);
  cv::distanceTransform(padded, depth, cv::DIST_L2, 5);
  depth = depth(cv::Rect(1, 1, labels.cols, labels.rows));
  cv::Mat trust = cv::Mat::zeros(labels.size(), CV_32F);
  for (int v = 0; v < labels.rows; ++v) {
    for (int u = 0; u < labels.cols; ++u) {
      const float d = depth.at<float>(v, u);
      if (d > 0.0f) trust.at<float>(v, u) = rimTrust(d);
    }
  }
  return trust;
}

// Light on one actor's visible surface, pixel by pixel.
struct Shaded {
  cv::Mat highlight;  // CV_32FC3: specular radiance
  cv::Mat light;      // CV_32FC3: shading of a white surface; 0 where the object is not seen
  cv::Mat nearness;   // CV_32FC1
  cv::Vec3f mean;
};

Shaded shade(const Actor& actor, const cv::Rect& region, const Camera& camera, const Light& light, const Gloss& gloss,
             const ShadowMap& sun) {
  Shaded s{cv::Mat::zeros(region.size(), CV_32FC3), cv::Mat::zeros(region.size(), CV_32FC3), cv::Mat::zeros(region.size(), CV_32F), {}};
  VisibilityBuffer buffer(region);
  buffer.draw(actor.screen, 0);
  const Eigen::Vector3f eye = camera.world_from_camera.translation().cast<float>();
  std::vector<cv::Vec3d> sums(region.height);
  std::vector<int> counts(region.height, 0);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region.height; ++v) {
    for (int u = 0; u < region.width; ++u) {
      const std::uint32_t id = buffer.ids(v)[u];
      if (id == VisibilityBuffer::kNothing) continue;
      const SurfacePoint p = surfacePoint(actor, VisibilityBuffer::triangleOf(id), u + region.x, v + region.y, eye);
      const float visible = sun.visibility(p.position, p.normal);
      const cv::Vec3f l = diffuseShading(light, p.normal, visible, p.sky);
      s.light.at<cv::Vec3f>(v, u) = l;
      s.highlight.at<cv::Vec3f>(v, u) = specularShading(light, gloss, p.normal, (eye - p.position).normalized(), visible, p.sky);
      s.nearness.at<float>(v, u) = buffer.nearness(v)[u];
      sums[v] += cv::Vec3d(l), ++counts[v];
    }
  }
  cv::Vec3d sum;
  int count = 0;
  for (int v = 0; v < region.height; ++v) sum += sums[v], count += counts[v];
  s.mean = count > 0 ? cv::Vec3f(sum / count) : cv::Vec3f(1, 1, 1);
  return s;
}

// The reflectance that one picture shows of an object.
struct Reflectance {
  cv::Rect region;
  cv::Mat albedo;    // CV_32FC3
  cv::Mat nearness;  // CV_32FC1: 1 / depth of the object's front, 0 = none
  cv::Mat trust;     // CV_32FC1
  cv::Vec3f mean_light;
};

// @param mean_light that of the key frame, where there is one
Reflectance reflectanceIn(const View& view, const Actor& actor, const Light& light, const Gloss& gloss, const ShadowMap& sun,
                          const std::optional<cv::Vec3f>& mean_light) {
  Reflectance r;
  const cv::Rect all(0, 0, view.picture.cols, view.picture.rows);
  cv::Rect mask_box = cv::boundingRect(view.labels == actor.surface->index);
  mask_box = mask_box.empty() ? mask_box : (mask_box + cv::Size(2 * kMargin, 2 * kMargin) - cv::Point(kMargin, kMargin)) & all;
  r.region = boundsOf(actor.screen, kMargin, view.picture.size()) | mask_box;
  if (r.region.empty()) r.region = cv::Rect(0, 0, 1, 1);
  const Shaded shaded = shade(actor, r.region, view.camera, light, gloss, sun);
  r.nearness = shaded.nearness;
  r.mean_light = mean_light.value_or(shaded.mean);
  const cv::Vec3f floor = lightFloor(r.mean_light);
  r.trust = trustOf(view.labels, actor.surface->index)(r.region).clone();
  r.albedo = cv::Mat(r.region.size(), CV_32FC3, cv::Scalar::all(0));
  for (int v = 0; v < r.region.height; ++v) {
    for (int u = 0; u < r.region.width; ++u) {
      if (r.nearness.at<float>(v, u) == 0.0f) {
        r.trust.at<float>(v, u) = 0.0f;
        continue;
      }
      const cv::Vec3f& code = view.picture.at<cv::Vec3f>(v + r.region.y, u + r.region.x);
      const cv::Vec3f& l = shaded.light.at<cv::Vec3f>(v, u);
      const cv::Vec3f& highlight = shaded.highlight.at<cv::Vec3f>(v, u);
      for (int c = 0; c < 3; ++c) {
        const float i = linearFromRealCode(code[c]);
        r.albedo.at<cv::Vec3f>(v, u)[c] = std::max(i - highlight[c], kMatt * i) / (l[c] + floor[c]);
      }
      r.trust.at<float>(v, u) *= std::min(1.0f, luminance(l) / (kLit * luminance(r.mean_light)));
    }
  }
  return r;
}

cv::Vec3f colourOf(const cv::Vec4f& c) { return {c[0], c[1], c[2]}; }

// How well a picture shows a surface point: 0 not at all, 1 straight on and well inside the mask.
struct Look {
  float weight = 0.0f;
  float u = 0.0f, v = 0.0f;  // in Reflectance::region
};

class TextureFill {
 public:
  TextureFill(const std::vector<const View*>& views, const std::vector<const Actor*>& actors, const std::vector<Reflectance>& pictures)
      : views_(views), actors_(actors), pictures_(pictures), surface_(*actors.front()->surface) {
    Eigen::AlignedBox3f box;
    for (const Eigen::Vector3f& p : surface_.key_vertices) box.extend(p);
    tolerance_ = kDepthTolerance * box.diagonal().norm();
    two_sided_ = std::any_of(surface_.edges.begin(), surface_.edges.end(), [](const MeshEdge& e) { return e.b < 0; });
    for (const View* v : views) camera_from_world_.push_back(v->camera.world_from_camera.inverse().cast<float>());
  }

  void run(Appearance& a) const {
    const Camera& camera = views_[0]->camera;
    const float depth = std::max(1e-6f, (camera_from_world_[0] * surface_.key_vertices.front()).z());
    a.texture = SurfaceTexture(surface_.key_vertices, surface_.triangles, depth / static_cast<float>(camera.fx), kMostTexels);
    const std::vector<MirrorPlane> planes = mirrorPlanes(surface_.key_vertices, surface_.triangles);
    std::vector<char> from(a.texture.size(), kFilled);
    std::vector<float> certain(a.texture.size(), 0.0f);
#pragma omp parallel for schedule(static)
    for (int t = 0; t < a.texture.triangleCount(); ++t) {
      for (std::size_t i = a.texture.firstOf(t); i < a.texture.firstOf(t + 1); ++i) {
        from[i] = look(t, a.texture.weightsOf(t, i - a.texture.firstOf(t)), planes, a.albedo, a.texture.texels[i], certain[i]);
      }
    }
    fillUnseen(certain, a.texture);
    const auto part = [&](char kind) { return static_cast<float>(std::count(from.begin(), from.end(), kind)) / std::max<std::size_t>(1, from.size()); };
    a.seen_in_key = part(kKey), a.seen_elsewhere = part(kElsewhere), a.mirrored = part(kMirrored);
  }

 private:
  enum From : char { kFilled, kKey, kElsewhere, kMirrored };

  Look lookAt(std::size_t view, const Eigen::Vector3f& p, const Eigen::Vector3f& n) const {
    const Reflectance& r = pictures_[view];
    const Camera& camera = views_[view]->camera;
    const Eigen::Vector3f q = camera_from_world_[view] * p;
    if (!(q.z() > 0.0f)) return {};
    const float facing = -n.dot(views_[view]->camera.world_from_camera.linear().cast<float>() * q) / q.norm();
    const float cosine = two_sided_ ? std::abs(facing) : facing;
    if (cosine < kFlattest) return {};
    const Eigen::Vector2d pixel = camera.project(q.cast<double>());
    Look look{0.0f, static_cast<float>(pixel.x()) - r.region.x, static_cast<float>(pixel.y()) - r.region.y};
    const int u = static_cast<int>(std::lround(std::clamp(look.u, -9.0f, r.region.width + 9.0f)));
    const int v = static_cast<int>(std::lround(std::clamp(look.v, -9.0f, r.region.height + 9.0f)));
    float trust = 0.0f;
    bool front = false;
    for (int y = std::max(0, v - 1); y <= std::min(r.region.height - 1, v + 1); ++y) {
      for (int x = std::max(0, u - 1); x <= std::min(r.region.width - 1, u + 1); ++x) {
        const float near = r.nearness.at<float>(y, x);
        if (near <= 0.0f || q.z() > 1.0f / near + tolerance_) continue;
        front = true;
        trust = std::max(trust, r.trust.at<float>(y, x));
      }
    }
    look.weight = front ? trust * std::min(1.0f, (cosine - kFlattest) / (kFull - kFlattest)) : 0.0f;
    return look;
  }

  // @param certain out: 1 = the texel is known, 0 = nothing of it
  From look(int triangle, const Eigen::Vector3f& w, const std::vector<MirrorPlane>& planes, const cv::Mat& key_albedo, cv::Vec4f& texel, float& certain) const {
    const Eigen::Vector3i& t = surface_.triangles[triangle];
    const auto mix = [&](const Points& x) -> Eigen::Vector3f { return w[0] * x[t[0]] + w[1] * x[t[1]] + w[2] * x[t[2]]; };
    cv::Vec3f sum;
    float total = 0.0f, key = 0.0f;
    for (std::size_t i = 0; i < views_.size(); ++i) {
      const Look l = lookAt(i, mix(actors_[i]->vertices), mix(actors_[i]->normals).normalized());
      if (l.weight <= 0.0f) continue;
      const float weight = l.weight * l.weight * l.weight * (i == 0 ? 1.0f : kFurther);
      sum += colourOf(sampleBicubic(i == 0 ? key_albedo : pictures_[i].albedo, l.u, l.v)) * weight;
      total += weight;
      if (i == 0) key = l.weight;
    }
    const float by_key = std::clamp(key / kEnough, 0.0f, 1.0f);
    certain = 1.0f;
    if (total > kSure) {
      texel = cv::Vec4f(sum[0] / total, sum[1] / total, sum[2] / total, by_key);
      return key > 0.0f ? kKey : kElsewhere;
    }
    const Eigen::Vector3f p = mix(surface_.key_vertices), n = mix(surface_.key_normals).normalized();
    for (const MirrorPlane& plane : planes) {
      const Eigen::Vector3f image = p - 2.0f * (plane.normal.dot(p) - plane.offset) * plane.normal;
      const Look l = lookAt(0, image, n - 2.0f * plane.normal.dot(n) * plane.normal);
      if (l.weight < kEnough) continue;
      // What is seen at a flat angle or in the shade goes over into the mirror image.
      const cv::Vec3f c = (sum + colourOf(sampleBicubic(key_albedo, l.u, l.v)) * (kSure - total)) / kSure;
      texel = cv::Vec4f(c[0], c[1], c[2], by_key);
      return total > kSeen ? kKey : kMirrored;
    }
    certain = 0.0f;
    if (total <= kSeen) return kFilled;
    // What is seen at the mask's rim alone has the background's colour in it.
    certain = std::min(1.0f, std::cbrt(total) / kEnough);
    certain *= certain;
    texel = cv::Vec4f(sum[0] / total, sum[1] / total, sum[2] / total, by_key);
    return key > 0.0f ? kKey : kElsewhere;
  }

  // What no picture shows, or none for certain, continues the surface around it.
  void fillUnseen(const std::vector<float>& certain, SurfaceTexture& texture) const {
    const Triangles& triangles = surface_.triangles;
    std::vector<cv::Vec3f> values(surface_.key_vertices.size());
    std::vector<float> parts(values.size(), 0.0f), best(values.size(), 0.0f);
    for (int t = 0; t < texture.triangleCount(); ++t) {
      for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
        Eigen::Index corner;
        const Eigen::Vector3f w = texture.weightsOf(t, i - texture.firstOf(t));
        w.maxCoeff(&corner);
        const int vertex = triangles[t][corner];
        values[vertex] += colourOf(texture.texels[i]) * certain[i], parts[vertex] += certain[i], best[vertex] = std::max(best[vertex], certain[i]);
      }
    }
    const float most = *std::max_element(best.begin(), best.end());
    std::vector<bool> known(values.size(), false);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (parts[i] > 0.0f) values[i] *= 1.0f / parts[i], known[i] = best[i] >= kKnown * most;
    }
    if (most == 0.0f) std::fill(values.begin(), values.end(), kUnknown);
    else diffuseOverMesh(surface_.key_vertices, triangles, known, values);
    for (int t = 0; t < texture.triangleCount(); ++t) {
      for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
        if (certain[i] >= 1.0f) continue;
        const Eigen::Vector3f w = texture.weightsOf(t, i - texture.firstOf(t));
        const cv::Vec3f around = values[triangles[t][0]] * w[0] + values[triangles[t][1]] * w[1] + values[triangles[t][2]] * w[2];
        const cv::Vec3f c = certain[i] * colourOf(texture.texels[i]) + (1.0f - certain[i]) * around;
        texture.texels[i] = cv::Vec4f(c[0], c[1], c[2], certain[i] * texture.texels[i][3]);
      }
    }
  }

  const std::vector<const View*>& views_;
  const std::vector<const Actor*>& actors_;
  const std::vector<Reflectance>& pictures_;
  const Surface& surface_;
  std::vector<Eigen::Isometry3f> camera_from_world_;
  float tolerance_ = 0.0f;  // m
  bool two_sided_ = false;  // an open sheet is seen from both sides
};

cv::Mat widened(const cv::Mat& colour) {
  cv::Mat wide;
  cv::cvtColor(colour, wide, cv::COLOR_BGR2BGRA);
  return wide;
}

Appearance::Source sourceOf(const SurfaceTexture& texture, int triangle) {
  bool picture = true, filled = true;
  for (std::size_t i = texture.firstOf(triangle); i < texture.firstOf(triangle + 1); ++i) {
    picture = picture && texture.texels[i][3] > kOnlyPicture, filled = filled && texture.texels[i][3] < kOnlyTexture;
  }
  return picture ? Appearance::Source::kPicture : filled ? Appearance::Source::kTexture : Appearance::Source::kBoth;
}

Appearance makeAppearance(const std::vector<View>& views, const std::vector<ShadowMap>& suns, std::size_t object, bool moves,
                          const Light& light, const Gloss& gloss) {
  Appearance a;
  a.gloss = gloss;
  a.key_camera = views[0].camera;
  std::vector<const View*> used;
  std::vector<const Actor*> actors;
  std::vector<Reflectance> pictures;
  for (std::size_t i = 0; i < (moves ? views.size() : 1); ++i) {
    used.push_back(&views[i]);
    actors.push_back(&views[i].actors[object]);
    const std::optional<cv::Vec3f> mean = i == 0 ? std::nullopt : std::make_optional(a.mean_light);
    pictures.push_back(reflectanceIn(views[i], *actors.back(), light, gloss, suns[i], mean));
    if (i == 0) a.mean_light = pictures[0].mean_light;
  }
  a.region = pictures[0].region;
  a.albedo = widened(pushPull(pictures[0].albedo, pictures[0].trust));
  for (Reflectance& r : pictures) r.albedo = widened(r.albedo);
  TextureFill(used, actors, pictures).run(a);
  a.findSources();
  return a;
}

}  // namespace

std::vector<Appearance> makeAppearances(const std::vector<View>& views, const std::vector<bool>& moves, const Light& light, const Gloss& gloss) {
  std::vector<ShadowMap> suns;
  for (const View& view : views) {
    std::vector<Occluder> occluders;
    for (const Actor& a : view.actors) occluders.push_back({&a.vertices, &a.surface->triangles, a.surface->winding});
    suns.emplace_back(occluders, light.direction.cast<double>(), ShadowMap::Params{kShadowMapSide, light.angular_radius, 16});
  }
  std::vector<Appearance> appearances;
  for (std::size_t i = 0; i < moves.size(); ++i) appearances.push_back(makeAppearance(views, suns, i, moves[i], light, gloss));
  return appearances;
}

void Appearance::findSources() {
  sources.clear();
  for (int t = 0; t < texture.triangleCount(); ++t) sources.push_back(sourceOf(texture, t));
}

cv::Vec3f Appearance::pictureAt(const Eigen::Vector3f& key_position) const {
  const Eigen::Vector2d q = key_camera.projectWorld(key_position.cast<double>());
  const cv::Vec4f c = sampleBicubic(albedo, static_cast<float>(q.x()) - region.x, static_cast<float>(q.y()) - region.y);
  return {c[0], c[1], c[2]};
}

cv::Vec3f Appearance::albedoAt(const SurfacePoint& point) const {
  const cv::Vec4f texel = texture.at(point.triangle, point.weights);
  if (texel[3] > kOnlyPicture) return pictureAt(point.key_position);
  const cv::Vec3f filled(texel[0], texel[1], texel[2]);
  return texel[3] < kOnlyTexture ? filled : filled * (1.0f - texel[3]) + pictureAt(point.key_position) * texel[3];
}

cv::Vec3f Appearance::radiance(const cv::Vec3f& albedo_at, const cv::Vec3f& now, const cv::Vec3f& highlight) const {
  return albedo_at.mul(now + lightFloor(mean_light)) + highlight;
}

cv::Vec4f sampleBicubic(const cv::Mat& image, float u, float v) {
  cv::Vec4f value;
  cv::v_store(value.val, bicubic(image, u, v));
  return value;
}

}  // namespace calipso::render

#include "texture/texture_fill.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "calipso_render/surface_symmetry.hpp"
#include "smooth_step.hpp"
#include "texture/mesh_topology.hpp"
#include "texture/texture_patches.hpp"
#include "texture/texture_seams.hpp"

namespace calipso::render {
namespace {

constexpr std::size_t kMostTexels = 300000;  // per object
// of the object's extent: a point that far behind the front is hidden
constexpr float kDepthTolerance = 0.012f;
// ... a like place that far before the front is not on the object
constexpr float kOffSurface = 0.03f;
constexpr float kFlattest = 0.05f,
                kFull = 0.25f;  // cosine of the view from which a surface is seen, and well seen
constexpr int kAnyPart = -1;
constexpr float kSameFace = 0.5f;  // cosine to the front's normal of what may be that front
constexpr float kEnough = 0.3f;    // weight of a look that needs no other
constexpr float kSeen = 1e-5f;     // sum of weights, cubed, below which a texel counts as not seen
// certainty, of the greatest there is, of what others are continued from
constexpr float kKnown = 0.5f;
constexpr float kSure = 0.2f;     // ... of which nothing else is needed
constexpr float kFurther = 0.3f;  // of further frames, whose poses are less exact
// the key frame's share in a colour with which it counts for nothing, and alone
constexpr float kOwnLow = 0.2f, kOwnHigh = 0.6f;
// weight of a look at a like place that counts for nothing, and in full
constexpr float kPoor = 0.15f, kGood = 0.45f;
constexpr float kAskew = 0.6f,
                kAlike = 0.9f;  // cosine between normals that are not, and are, mirror images
constexpr float kQuarter = 0.25f * static_cast<float>(M_PI);
constexpr float kTurns[] = {
    0.0f, 0.5f, -0.5f};  // rad: middles of the part of a body of revolution that others repeat
// of the extent: within it what is not seen goes over from the seen around it to the common colour
constexpr float kFromSeen = 0.1f;
constexpr std::size_t kLookedAt = 300;       // texels, for that
const cv::Vec3f kUnknown(0.3f, 0.3f, 0.3f);  // reflectance of an object that no picture shows

cv::Vec3f colourOf(const cv::Vec4f& c) { return {c[0], c[1], c[2]}; }

// A point of the surface, world axes, key frame.
struct Place {
  Eigen::Vector3f point, normal;
  int part = kAnyPart;  // of the mesh, that has to be seen there
};

// Turns places about an axis into the quarter of a turn on either side of `middle`, back and forth,
// so that what is near each other stays so.
struct Fold {
  Axis axis;
  Eigen::Vector3f ahead, aside;  // span the plane across the axis; `ahead` is the middle

  Place operator()(const Place& place) const {
    const Eigen::Vector3f arm = place.point - axis.point;
    const float angle = std::atan2(arm.dot(aside), arm.dot(ahead));
    const float turns =
        angle / (4.0f * kQuarter) + 0.25f;  // whole numbers where the sense changes back
    const float phase = turns - std::floor(turns);
    const bool back = phase > 0.5f;
    const float folded = 4.0f * kQuarter * ((back ? 1.0f - phase : phase) - 0.25f);
    if (!back) return turned(place, folded - angle);
    // The mirror image across the plane through the axis that maps the one angle to the other.
    const float half = 0.5f * (angle + folded);
    const Eigen::Vector3f across = std::cos(half) * aside - std::sin(half) * ahead;
    const MirrorPlane plane{across, across.dot(axis.point)};
    return {plane.point(place.point), plane.vector(place.normal), place.part};
  }

 private:
  Place turned(const Place& place, float angle) const {
    const Eigen::AngleAxisf rotation(angle, axis.direction);
    return {axis.point + rotation * (place.point - axis.point), rotation * place.normal,
            place.part};
  }
};

std::vector<Fold> foldsOf(const Axis& axis, const Eigen::Vector3f& eye) {
  std::vector<Fold> folds;
  const Eigen::Vector3f to_eye = eye - axis.point;
  const Eigen::Vector3f ahead = (to_eye - axis.direction * axis.direction.dot(to_eye)).normalized();
  if (!ahead.allFinite() || ahead.isZero()) return folds;
  for (const float turn : kTurns) {
    const Eigen::Vector3f middle = Eigen::AngleAxisf(turn, axis.direction) * ahead;
    folds.push_back({axis, middle, axis.direction.cross(middle)});
  }
  return folds;
}

// Colours laid one over the other: each takes up a part of what those before it left open.
struct Layers {
  cv::Vec3f sum;
  float open = 1.0f, most = 0.0f;
  int count = 0, strongest = -1;  // layers so far; the one that took up most

  void add(const cv::Vec3f& colour, float part) {
    sum += colour * (open * part);
    if (open * part > most) most = open * part, strongest = count;
    open *= 1.0f - part;
    ++count;
  }
};

// How well a picture shows a place: 0 not at all, 1 straight on and well inside the mask.
struct Look {
  float weight = 0.0f;
  // pixels per area of surface, 1 = straight on from where the key frame's camera is
  float detail = 0.0f;
  float u = 0.0f, v = 0.0f;  // in Reflectance::region
};

class TextureFill {
 public:
  explicit TextureFill(const SeenObject& object)
      : views_(object.views),
        actors_(object.actors),
        pictures_(object.pictures),
        surface_(*object.actors.front()->surface) {
    extent_ = boxOf(surface_.key_vertices).diagonal().norm();
    two_sided_ = std::any_of(surface_.edges.begin(), surface_.edges.end(),
                             [](const MeshEdge& e) { return e.b < 0; });
    for (const View* v : views_)
      camera_from_world_.push_back(v->camera.world_from_camera.inverse().cast<float>());
    key_depth_ = std::max(1e-6f, (camera_from_world_[0] * surface_.key_vertices.front()).z());
    parts_ = connectedParts(surface_.key_vertices, surface_.triangles);
    planes_ = mirrorPlanes(surface_.key_vertices, surface_.triangles);
    if (const auto axis = revolutionAxis(surface_.key_vertices, surface_.triangles)) {
      folds_ = foldsOf(*axis, views_[0]->camera.world_from_camera.translation().cast<float>());
    }
  }

  void run(Appearance& a) const {
    const Camera& camera = views_[0]->camera;
    const Eigen::Vector3f down = camera.world_from_camera.linear().col(1).cast<float>();
    a.texture = SurfaceTexture(surface_.key_vertices, surface_.triangles,
                               key_depth_ / static_cast<float>(camera.fx), kMostTexels);
    std::vector<char> from(a.texture.size(), kFilled);
    std::vector<float> certain(a.texture.size(), 0.0f);
    std::vector<signed char> layer(a.texture.size(), -1);
#pragma omp parallel for schedule(static)
    for (int t = 0; t < a.texture.triangleCount(); ++t) {
      for (std::size_t i = a.texture.firstOf(t); i < a.texture.firstOf(t + 1); ++i) {
        from[i] = texelAt(t, a.texture.weightsOf(t, i - a.texture.firstOf(t)), a.albedo,
                          a.texture.texels[i], certain[i], layer[i]);
      }
    }
    levelSeams(surface_.key_vertices, surface_.triangles, layer, a.texture);
    continuePattern(surface_.key_vertices, surface_.triangles, down, certain, a.texture);
    fillUnseen(certain, a.texture);
    const auto part = [&](char kind) {
      return static_cast<float>(std::count(from.begin(), from.end(), kind)) /
             std::max<std::size_t>(1, from.size());
    };
    a.seen_in_key = part(kKey), a.seen_elsewhere = part(kElsewhere), a.copied = part(kCopied);
  }

 private:
  enum From : char { kFilled, kKey, kElsewhere, kCopied };

  // The pixel of a picture that a point comes to, if it is before the camera.
  std::optional<Look> pixelOf(std::size_t view, const Eigen::Vector3f& in_camera) const {
    if (!(in_camera.z() > 0.0f)) return std::nullopt;
    const Eigen::Vector2d pixel = views_[view]->camera.project(in_camera.cast<double>());
    const cv::Rect& region = pictures_[view].region;
    return Look{0.0f, 0.0f, static_cast<float>(pixel.x()) - region.x,
                static_cast<float>(pixel.y()) - region.y};
  }

  // A part that lies just under another one, or behind it, is not seen there.
  bool ofPart(const Reflectance& r, const cv::Point& pixel, const Place& place) const {
    return place.part == kAnyPart || place.part == parts_[r.triangle.at<int>(pixel)];
  }

  bool sameFace(const Reflectance& r, const cv::Point& pixel, const Place& place) const {
    const cv::Vec3f& n = r.normal.at<cv::Vec3f>(pixel);
    const float alike = place.normal.dot(Eigen::Vector3f(n[0], n[1], n[2]));
    return ofPart(r, pixel, place) && (two_sided_ ? std::abs(alike) : alike) >= kSameFace;
  }

  // The best trust around a pixel among those of the object's front that `accepts` takes.
  template <typename Accepts>
  float trustAround(std::size_t view, const Look& look, Accepts accepts) const {
    const Reflectance& r = pictures_[view];
    const int u = static_cast<int>(std::lround(std::clamp(look.u, -9.0f, r.region.width + 9.0f)));
    const int v = static_cast<int>(std::lround(std::clamp(look.v, -9.0f, r.region.height + 9.0f)));
    float trust = 0.0f;
    for (int y = std::max(0, v - 1); y <= std::min(r.region.height - 1, v + 1); ++y) {
      for (int x = std::max(0, u - 1); x <= std::min(r.region.width - 1, u + 1); ++x) {
        const cv::Point pixel(x, y);
        if (r.nearness.at<float>(pixel) > 0.0f && accepts(pixel))
          trust = std::max(trust, r.trust.at<float>(pixel));
      }
    }
    return trust;
  }

  // @param before how far, in extents, the place may lie before the front that is seen there
  Look lookAt(std::size_t view, const Place& place, float before) const {
    const Eigen::Vector3f q = camera_from_world_[view] * place.point;
    const auto pixel = pixelOf(view, q);
    if (!pixel) return {};
    const float facing =
        -place.normal.dot(views_[view]->camera.world_from_camera.linear().cast<float>() * q) /
        q.norm();
    const float cosine = two_sided_ ? std::abs(facing) : facing;
    if (cosine < kFlattest) return {};
    Look look = *pixel;
    const float trust = trustAround(view, look, [&](const cv::Point& pixel) {
      const Reflectance& r = pictures_[view];
      const float depth = 1.0f / r.nearness.at<float>(pixel);
      return q.z() <= depth + kDepthTolerance * extent_ && q.z() >= depth - before * extent_ &&
             sameFace(r, pixel, place);
    });
    look.weight = trust * std::min(1.0f, (cosine - kFlattest) / (kFull - kFlattest));
    look.detail = cosine *
                  static_cast<float>(std::pow(views_[view]->camera.fx / views_[0]->camera.fx, 2)) *
                  std::pow(key_depth_ / q.z(), 2.0f);
    return look;
  }

  // The front of the object before a place, where that is the front's mirror image across the plane
  // of the picture.
  Look frontBefore(const Place& place) const {
    auto look = pixelOf(0, camera_from_world_[0] * place.point);
    const Reflectance& r = pictures_[0];
    const cv::Point pixel =
        look ? cv::Point(std::lround(look->u), std::lround(look->v)) : cv::Point(-1, -1);
    if (!cv::Rect(cv::Point(), r.region.size()).contains(pixel) ||
        r.nearness.at<float>(pixel) <= 0.0f || !ofPart(r, pixel, place))
      return {};
    const Eigen::Vector3f sight =
        (place.point - views_[0]->camera.world_from_camera.translation().cast<float>())
            .normalized();
    const cv::Vec3f& front = r.normal.at<cv::Vec3f>(pixel);
    const Eigen::Vector3f mirrored =
        MirrorPlane{sight, 0.0f}.vector({front[0], front[1], front[2]});
    look->weight =
        r.trust.at<float>(pixel) * smoothStep(kAskew, kAlike, mirrored.dot(place.normal));
    return *look;
  }

  float clearAt(std::size_t view, const Look& look) const {
    const cv::Mat& clear = pictures_[view].clear;
    const int u = std::clamp(static_cast<int>(std::lround(look.u)), 0, clear.cols - 1),
              v = std::clamp(static_cast<int>(std::lround(look.v)), 0, clear.rows - 1);
    return clear.at<float>(v, u);
  }

  // Of the pictures that show a place, those count most that show it in most detail, and not in a
  // highlight: the light tells that too badly to be taken off without a trace.
  // @param certain out: 1 = the texel is known, 0 = nothing of it; layer out: where most of it
  // comes from, 0 = the place itself, -1 = nowhere
  From texelAt(int triangle, const Eigen::Vector3f& w, const cv::Mat& key_albedo, cv::Vec4f& texel,
               float& certain, signed char& layer) const {
    const auto mix = [&w](const Points& x, const Eigen::Vector3i& t) -> Eigen::Vector3f {
      return w[0] * x[t[0]] + w[1] * x[t[1]] + w[2] * x[t[2]];
    };
    const auto placeOf = [&](const Points& vertices, const Points& normals) -> Place {
      return {mix(vertices, surface_.triangles[triangle]),
              mix(normals, surface_.corners[triangle]).normalized(), parts_[triangle]};
    };
    cv::Vec3f sum;
    float total = 0.0f, shares = 0.0f, key = 0.0f, key_share = 0.0f;
    for (std::size_t i = 0; i < views_.size(); ++i) {
      const Look l = lookAt(i, placeOf(actors_[i]->vertices, actors_[i]->normals), 1.0f);
      if (l.weight <= 0.0f) continue;
      const float weight = l.weight * l.weight * l.weight, telling = l.detail * clearAt(i, l),
                  share = weight * telling * telling;
      sum += colourOf(sampleBicubic(i == 0 ? key_albedo : pictures_[i].albedo, l.u, l.v)) * share;
      total += weight * (i == 0 ? 1.0f : kFurther), shares += share;
      if (i == 0) key = l.weight, key_share = share;
    }
    if (shares > 0.0f) sum *= 1.0f / shares, key_share *= 1.0f / shares;
    Layers layers;
    layers.add(sum, std::min(1.0f, total / kSure));
    if (layers.open > 0.0f)
      addLikePlaces(placeOf(surface_.key_vertices, surface_.key_normals), key_albedo, sum, total,
                    layers);
    certain = 1.0f - layers.open;
    layer = static_cast<signed char>(layers.strongest);
    const cv::Vec3f c = certain > 0.0f ? layers.sum / certain : cv::Vec3f();
    texel =
        cv::Vec4f(c[0], c[1], c[2],
                  std::clamp(key / kEnough, 0.0f, 1.0f) * smoothStep(kOwnLow, kOwnHigh, key_share));
    if (total > kSeen) return key > 0.0f ? kKey : kElsewhere;
    return certain > 0.5f ? kCopied : kFilled;
  }

  // What is seen at a flat angle, at the mask's rim (where the background's colour is in it) or not
  // at all.
  // @param own, total the place's own colour as far as it is seen, and the weight of that
  void addLikePlaces(const Place& place, const cv::Mat& key_albedo, const cv::Vec3f& own,
                     float total, Layers& layers) const {
    const auto add = [&](const Look& l, float part) {
      layers.add(part > 0.0f ? colourOf(sampleBicubic(key_albedo, l.u, l.v)) : cv::Vec3f(), part);
    };
    const auto addPlace = [&](const Place& like) {
      const Look l = lookAt(0, like, kOffSurface);
      add(l, smoothStep(kPoor, kGood, l.weight));
    };
    for (const MirrorPlane& plane : planes_)
      addPlace({plane.point(place.point), plane.vector(place.normal)});
    for (const Fold& fold : folds_) addPlace(fold(place));
    const float flat = std::min(1.0f, std::cbrt(total) / kEnough);
    layers.add(own, flat * flat);
    const Look front = frontBefore(place);
    add(front, smoothStep(0.0f, kGood, front.weight));
  }

  // The reflectance that most of what is known has: that of the texel nearest to all others, with
  // the quarter of them that is most like it.
  static cv::Vec3f commonColour(const std::vector<float>& certain, const SurfaceTexture& texture) {
    std::vector<cv::Vec3f> known, some;
    for (std::size_t i = 0; i < certain.size(); ++i) {
      if (certain[i] >= 1.0f) known.push_back(colourOf(texture.texels[i]));
    }
    if (known.empty()) return kUnknown;
    const std::size_t step = (known.size() + kLookedAt - 1) / kLookedAt;
    for (std::size_t i = 0; i < known.size(); i += step) some.push_back(known[i]);
    const auto away = [](const cv::Vec3f& a, const cv::Vec3f& b) { return cv::norm(a - b); };
    cv::Vec3f middle;
    double least = 1e30;
    for (const cv::Vec3f& a : some) {
      double sum = 0.0;
      for (const cv::Vec3f& b : some) sum += away(a, b);
      if (sum < least) least = sum, middle = a;
    }
    const std::size_t quarter = (some.size() + 3) / 4;
    std::sort(some.begin(), some.end(), [&](const cv::Vec3f& a, const cv::Vec3f& b) {
      return away(a, middle) < away(b, middle);
    });
    return std::accumulate(some.begin(), some.begin() + quarter, cv::Vec3f()) *
           (1.0f / static_cast<float>(quarter));
  }

  // What no picture shows, or none for certain, continues the surface around it, and goes over to
  // what the object is like on the whole: the rim of what is seen is seen flatly, with the sky and
  // the background in it.
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
        values[vertex] += colourOf(texture.texels[i]) * certain[i], parts[vertex] += certain[i],
            best[vertex] = std::max(best[vertex], certain[i]);
      }
    }
    const float most = *std::max_element(best.begin(), best.end());
    std::vector<bool> known(values.size(), false);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (parts[i] > 0.0f) values[i] *= 1.0f / parts[i], known[i] = best[i] >= kKnown * most;
    }
    if (most == 0.0f)
      std::fill(values.begin(), values.end(), kUnknown);
    else
      diffuseOverMesh(surface_.key_vertices, triangles, known, values,
                      FarValue{commonColour(certain, texture), kFromSeen * extent_});
    for (int t = 0; t < texture.triangleCount(); ++t) {
      for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
        if (certain[i] >= 1.0f) continue;
        const Eigen::Vector3f w = texture.weightsOf(t, i - texture.firstOf(t));
        const cv::Vec3f around = values[triangles[t][0]] * w[0] + values[triangles[t][1]] * w[1] +
                                 values[triangles[t][2]] * w[2];
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
  std::vector<int> parts_;  // connectedParts()
  std::vector<MirrorPlane> planes_;
  std::vector<Fold> folds_;
  float extent_ = 0.0f, key_depth_ = 1.0f;  // m
  bool two_sided_ = false;                  // an open sheet is seen from both sides
};

}  // namespace

void fillTexture(const SeenObject& object, Appearance& a) { TextureFill(object).run(a); }

}  // namespace calipso::render

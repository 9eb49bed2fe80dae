#include "texture/texture_fill.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "calipso_render/surface_symmetry.hpp"
#include "model_details.hpp"
#include "smooth_step.hpp"
#include "texture/bent_shape.hpp"
#include "texture/colour_layers.hpp"
#include "texture/hidden_front.hpp"
#include "texture/like_places.hpp"
#include "texture/like_texels.hpp"
#include "texture/picture_trust.hpp"
#include "texture/sightings.hpp"
#include "texture/texel_budget.hpp"
#include "texture/texture_miss.hpp"
#include "texture/texture_patches.hpp"
#include "texture/texture_seams.hpp"
#include "texture/texture_unseen.hpp"

namespace calipso::render {
namespace {

// of the object's extent: a like place that far before the front is not on the object
constexpr float kOffSurface = 0.03f;
constexpr float kEnough = 0.3f;   // weight of a look that needs no other
constexpr float kSeen = 1e-5f;    // sum of weights, cubed, below which a texel counts as not seen
constexpr float kSure = 0.2f;     // ... of which nothing else is needed
constexpr float kFurther = 0.3f;  // of further frames, whose poses are less exact
// the key frame's share in a colour with which it counts for nothing, and alone
constexpr float kOwnLow = 0.2f, kOwnHigh = 0.6f;
// weight of a look at a like place that counts for nothing, and in full
constexpr float kPoor = 0.15f, kGood = 0.45f;

constexpr float kLikeEnough = 0.5f;     // certainty from which a like place tells what is hidden
constexpr float kLikeReach = 2.0f;      // spacings of texels
constexpr std::size_t kMostTurned = 3;  // turned places that a place takes its look from
// texels, about, by which like places are judged; of the stock model, where that takes longer
constexpr std::size_t kCompared = 20000, kComparedOfStock = 5000;

cv::Vec3f colourOf(const cv::Vec4f& c) { return {c[0], c[1], c[2]}; }

// How one of the pictures shows a place.
struct Look {
  int view;
  float u, v;   // in Reflectance::region
  float share;  // in the place's colour, against other looks at it
};

// How the pictures show a texel.
struct Seen {
  float total = 0.0f;     // how well, sum of weights, cubed
  float key = 0.0f;       // Sighting::weight in the key frame
  std::uint32_t end = 0;  // of its looks, among those at its triangle
};

class TextureFill {
 public:
  explicit TextureFill(const SeenObject& object)
      : views_(object.views),
        actors_(object.actors),
        pictures_(object.pictures),
        surface_(*object.actors.front()->surface),
        sightings_(object) {}

  void run(Appearance& a) {
    const Camera& camera = views_[0]->camera;
    const Eigen::Vector3f down = camera.world_from_camera.linear().col(1).cast<float>();
    a.texture = SurfaceTexture(surface_.key_vertices, surface_.triangles,
                               sightings_.keyDepth() / static_cast<float>(camera.fx),
                               mostTexels(camera, views_.size()));
    Origins origins(a.texture.size());
    for (const Reflectance& r : pictures_) shown_.push_back(r.albedo);
    shown_[0] = copied_ = a.albedo;
    beside_details_ = besideDetails(pictures_[0], surface_);
    findLooks(a.texture);
    makeTexels(a.texture, origins);
    findLike(a.texture, origins);
    if (views_.size() > 1) copied_ = sharpen({views_, actors_, pictures_}, a.texture, shown_);
    makeTexels(a.texture, origins);
    if (views_.size() > 1) copyLike(a.texture, origins);
    fillHiddenFront(a.texture, origins);
    if (views_.size() > 1) a.grain = grainOf({views_, actors_, pictures_}, a.texture);
    auto& [from, certain, layer] = origins;
    levelSeams(surface_.key_vertices, surface_.triangles, layer, a.texture);
    continuePattern(surface_.key_vertices, surface_.triangles, down, certain, a.texture);
    fillUnseen(surface_, sightings_.pieces(), sightings_.parts(), faintColours(a.texture, certain),
               certain, a.texture);
    const auto part = [&](char kind) {
      return static_cast<float>(std::count(from.begin(), from.end(), kind)) /
             std::max<std::size_t>(1, from.size());
    };
    a.seen_in_key = part(kKey), a.seen_elsewhere = part(kElsewhere), a.copied = part(kCopied);
  }

 private:
  enum From : char { kFilled, kKey, kElsewhere, kCopied };

  // Per texel: how it was seen; 1 = it is known, 0 = nothing of it; where most of it comes from,
  // 0 = the place itself, -1 = nowhere.
  struct Origins {
    std::vector<char> from;
    std::vector<float> certain;
    std::vector<signed char> layer;

    explicit Origins(std::size_t texels) : from(texels), certain(texels), layer(texels) {}
  };

  // How the pictures show a triangle's texels.
  struct Looks {
    std::vector<Look> all;
    std::vector<Seen> texels;
  };

  void findLooks(const SurfaceTexture& texture) {
    looks_.resize(texture.triangleCount());
#pragma omp parallel
    {
      std::vector<Look> found;
#pragma omp for schedule(dynamic, 64)
      for (int t = 0; t < texture.triangleCount(); ++t) {
        const std::size_t texels = texture.firstOf(t + 1) - texture.firstOf(t);
        Looks& looks = looks_[t];
        found.clear();
        looks.texels.reserve(texels);
        const std::vector<std::size_t> showing = viewsShowing(t);
        for (std::size_t i = 0; i < texels; ++i)
          looks.texels.push_back(addLooks(t, texture.weightsOf(t, i), showing, found));
        looks.all = found;
      }
    }
  }

  // The views that may show points of a triangle.
  std::vector<std::size_t> viewsShowing(int triangle) const {
    const Eigen::Vector3i &t = surface_.triangles[triangle], &c = surface_.corners[triangle];
    std::vector<std::size_t> showing;
    for (std::size_t i = 0; i < views_.size(); ++i) {
      const Actor& a = *actors_[i];
      if (sightings_.mayShow(i, {Place{a.vertices[t[0]], a.normals[c[0]]},
                                 {a.vertices[t[1]], a.normals[c[1]]},
                                 {a.vertices[t[2]], a.normals[c[2]]}}))
        showing.push_back(i);
    }
    return showing;
  }

  // Of the pictures that show a place, those count most that show it in most detail, and not in a
  // highlight: the light tells that too badly to be taken off without a trace.
  Seen addLooks(int triangle, const Eigen::Vector3f& w, const std::vector<std::size_t>& showing,
                std::vector<Look>& looks) const {
    Seen seen;
    for (const std::size_t i : showing) {
      const Sighting l = sightings_.lookAt(
          i, placeOf(triangle, w, actors_[i]->vertices, actors_[i]->normals), 1.0f);
      if (l.weight <= 0.0f) continue;
      const float telling = l.detail * sightings_.clearAt(i, l),
                  cubed = l.weight * l.weight * l.weight;
      looks.push_back({static_cast<int>(i), l.u, l.v, cubed * telling * telling});
      seen.total += cubed * (i == 0 ? 1.0f : kFurther);
      if (i == 0) seen.key = l.weight;
    }
    seen.end = static_cast<std::uint32_t>(looks.size());
    return seen;
  }

  void makeTexels(SurfaceTexture& texture, Origins& origins) const {
#pragma omp parallel for schedule(dynamic, 64)
    for (int t = 0; t < texture.triangleCount(); ++t) {
      const Looks& looks = looks_[t];
      const std::size_t first = texture.firstOf(t);
      const Look* look = looks.all.data();
      for (std::size_t i = 0; i < looks.texels.size(); ++i) {
        const Seen& seen = looks.texels[i];
        const Look* end = looks.all.data() + seen.end;
        origins.from[first + i] =
            texelAt(t, texture.weightsOf(t, i), seen, look, end, texture.texels[first + i],
                    origins.certain[first + i], origins.layer[first + i]);
        look = end;
      }
    }
  }

  FaintColours faintColours(const SurfaceTexture& texture,
                            const std::vector<float>& certain) const {
    const std::vector<int>& shells = sightings_.parts();
    std::vector<cv::Vec3f> sums(1 + *std::max_element(shells.begin(), shells.end()));
    std::vector<float> weights(sums.size(), 0.0f);
    std::vector<std::size_t> known(sums.size(), 0);
    for (int t = 0; t < texture.triangleCount(); ++t) {
      for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i)
        known[shells[t]] += certain[i] >= 1.0f;
    }
    for (std::size_t t = 0; t < looks_.size(); ++t) {
      if (known[shells[t]] >= kFewestKnown) continue;
      for (const Look& look : looks_[t].all) {
        sums[shells[t]] += look.share * colourOf(sampleBicubic(shown_[look.view], look.u, look.v));
        weights[shells[t]] += look.share;
      }
    }
    FaintColours colours(sums.size());
    for (std::size_t k = 0; k < sums.size(); ++k) {
      if (weights[k] > 0.0f) colours[k] = sums[k] * (1.0f / weights[k]);
    }
    return colours;
  }

  Place placeOf(int triangle, const Eigen::Vector3f& w, const Points& vertices,
                const Points& normals) const {
    const auto mix = [&w](const Points& x, const Eigen::Vector3i& t) -> Eigen::Vector3f {
      return w[0] * x[t[0]] + w[1] * x[t[1]] + w[2] * x[t[2]];
    };
    return {mix(vertices, surface_.triangles[triangle]),
            mix(normals, surface_.corners[triangle]).normalized(), sightings_.partOf(triangle)};
  }
  Place keyPlaceOf(int triangle, const Eigen::Vector3f& w) const {
    return placeOf(triangle, w, surface_.key_vertices, surface_.key_normals);
  }
  // In the shape in which likenesses are sought.
  Place shapePlaceOf(int triangle, const Eigen::Vector3f& w) const {
    Place place = bent_ ? placeOf(triangle, w, surface_.stock_vertices, stock_normals_)
                        : keyPlaceOf(triangle, w);
    place.piece = sightings_.pieceOf(triangle);
    const Eigen::Vector3i& c = surface_.corners[triangle];
    place.open = w[0] * surface_.seen[c[0]].open + w[1] * surface_.seen[c[1]].open +
                 w[2] * surface_.seen[c[2]].open;
    return place;
  }

  // How the key frame shows a place of that shape.
  Sighting lookAtShape(const Place& place) const {
    const std::optional<Place> there = bent_ ? (*bent_)(place) : place;
    return there ? sightings_.lookAt(0, *there, kOffSurface) : Sighting();
  }

  struct Likenesses {
    std::vector<LikePlace> mirrored, turned;
    std::size_t size() const { return mirrored.size() + turned.size(); }
  };

  Likenesses likenessesOf(const Points& vertices) const {
    const Eigen::Vector3f eye = views_[0]->camera.world_from_camera.translation().cast<float>();
    // What the model lacks is found where the camera sees it: that is symmetric to nothing.
    const Points of_model = withoutDetails(surface_, vertices);
    const Triangles triangles = modelTriangles(surface_);
    return {mirroredPlaces(mirrorPlanes(of_model, triangles), vertices, surface_.triangles,
                           sightings_.parts()),
            turnedPlaces(of_model, triangles, eye)};
  }

  // Of the object's shape, or of its stock model's where that has more of them: bent things are as
  // they were made. But how a cloth is cut tells nothing of its print.
  Likenesses likenesses() {
    Likenesses own = likenessesOf(surface_.key_vertices);
    if (sightings_.isSheet() || surface_.stock_vertices == surface_.key_vertices) return own;
    Likenesses stock = likenessesOf(surface_.stock_vertices);
    if (stock.size() <= own.size()) return own;
    stock_normals_ = surfaceNormals(surface_, surface_.stock_vertices);
    bent_.emplace(surface_.stock_vertices, surface_.key_vertices, surface_.triangles,
                  sightings_.parts());
    return stock;
  }

  // Places that look alike by the shape; those first that do where they are seen themselves.
  void findLike(const SurfaceTexture& texture, const Origins& origins) {
    Likenesses like = likenesses();
    std::vector<KnownPlace> known;
    const std::size_t step = 1 + texture.size() / (bent_ ? kComparedOfStock : kCompared);
    std::size_t next = 0;
    for (int t = 0; t < texture.triangleCount() && !isDetail(surface_, t); ++t) {
      for (; next < texture.firstOf(t + 1); next += step) {
        if (origins.layer[next] == 0 && origins.certain[next] >= 1.0f)
          known.push_back({shapePlaceOf(t, texture.weightsOf(t, next - texture.firstOf(t))),
                           colourOf(texture.texels[next])});
      }
    }
    const auto colourAt = [&](const Place& place) -> std::optional<cv::Vec3f> {
      const Sighting l = lookAtShape(place);
      if (l.weight < kGood) return std::nullopt;
      return colourOf(sampleBicubic(shown_[0], l.u, l.v));
    };
    judgeLikePlaces(known, texture.spacing(), colourAt, like.mirrored);
    judgeLikePlaces(known, texture.spacing(), colourAt, like.turned);
    like_ = bestFirst(std::move(like.mirrored), std::move(like.turned), kMostTurned);
  }

  // @param look, end the looks at the place. @param certain, layer out: of Origins
  From texelAt(int triangle, const Eigen::Vector3f& w, const Seen& seen, const Look* look,
               const Look* end, cv::Vec4f& texel, float& certain, signed char& layer) const {
    const float total = seen.total, key = seen.key;
    cv::Vec3f sum;
    float shares = 0.0f, key_share = 0.0f;
    for (; look != end; ++look) {
      sum += colourOf(sampleBicubic(shown_[look->view], look->u, look->v)) * look->share;
      shares += look->share;
      if (look->view == 0) key_share = look->share;
    }
    if (shares > 0.0f) sum *= 1.0f / shares, key_share *= 1.0f / shares;
    Layers layers;
    layers.add(sum, std::min(1.0f, total / kSure));
    if (layers.open > 0.0f) addLikePlaces(triangle, w, sum, total, layers);
    certain = 1.0f - layers.open;
    layer = static_cast<signed char>(layers.strongest);
    const cv::Vec3f c = certain > 0.0f ? layers.sum / certain : cv::Vec3f();
    texel =
        cv::Vec4f(c[0], c[1], c[2],
                  std::clamp(key / kEnough, 0.0f, 1.0f) * smoothStep(kOwnLow, kOwnHigh, key_share));
    if (total > kSeen) return key > 0.0f ? kKey : kElsewhere;
    return certain > 0.5f ? kCopied : kFilled;
  }

  // Of what is at best seen at a flat angle: from texels that other frames than the key frame told.
  void copyLike(SurfaceTexture& texture, Origins& origins) const {
    if (like_.empty()) return;
    std::vector<KnownTexels::Texel> known;
    std::vector<std::pair<std::size_t, Place>> poor;
    for (int t = 0; t < texture.triangleCount(); ++t) {
      for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
        const int layer = origins.layer[i];
        const bool is_poor = layer < 0 || layer > static_cast<int>(like_.size()),
                   in_key = looks_[t].texels[i - texture.firstOf(t)].key >= kGood,
                   is_known = layer == 0 && !in_key && origins.certain[i] >= 1.0f;
        if (!is_poor && !is_known) continue;
        const Eigen::Vector3f w = texture.weightsOf(t, i - texture.firstOf(t));
        Place place = shapePlaceOf(t, w);
        if (is_poor && !lacksLike(t, w)) poor.push_back({i, place});
        if (!is_known) continue;
        place.part = sightings_.partOf(t);
        known.push_back({place, colourOf(texture.texels[i])});
      }
    }
    if (known.empty()) return;
    const KnownTexels texels(std::move(known), kLikeReach * texture.spacing());
#pragma omp parallel for schedule(dynamic, 256)
    for (std::size_t k = 0; k < poor.size(); ++k) {
      const auto& [i, place] = poor[k];
      for (std::size_t j = 0; j < like_.size(); ++j) {
        const auto colour = texels.at(like_[j].of(place));
        if (!colour) continue;
        texture.texels[i] = cv::Vec4f((*colour)[0], (*colour)[1], (*colour)[2], 0.0f);
        origins.certain[i] = 1.0f, origins.layer[i] = static_cast<signed char>(j + 1);
        origins.from[i] = kCopied;
        break;
      }
    }
  }

  // What another object hides in the key frame.
  void fillHiddenFront(SurfaceTexture& texture, Origins& origins) const {
    const std::optional<Reflectance> front =
        hiddenFront(views_[0]->labels, surface_, sightings_.pieces(), pictures_[0]);
    if (!front) return;
    const std::vector<const View*> views = {views_[0]};
    const std::vector<const Actor*> actors = {actors_[0]};
    const std::vector<Reflectance> pictures = {*front};
    const Sightings sightings({views, actors, pictures});
#pragma omp parallel for schedule(dynamic, 64)
    for (int t = 0; t < texture.triangleCount(); ++t) {
      for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
        const Seen& seen = looks_[t].texels[i - texture.firstOf(t)];
        if (seen.total >= kSure) continue;
        const Sighting look =
            sightings.lookAt(0, keyPlaceOf(t, texture.weightsOf(t, i - texture.firstOf(t))), 1.0f);
        if (look.weight <= 0.0f) continue;
        const cv::Vec3f colour = colourOf(sampleBicubic(front->albedo, look.u, look.v));
        texture.texels[i] = cv::Vec4f(colour[0], colour[1], colour[2], 0.0f);
        origins.certain[i] = 1.0f, origins.layer[i] = 0;
      }
    }
  }

  // What is seen at a flat angle, at the mask's rim (where the background's colour is in it) or not
  // at all.
  // @param own, total the place's own colour as far as it is seen, and the weight of that
  void addLikePlaces(int triangle, const Eigen::Vector3f& w, const cv::Vec3f& own, float total,
                     Layers& layers) const {
    const Place place = shapePlaceOf(triangle, w);
    const auto add = [&](const Sighting& l, float part) {
      layers.add(part > 0.0f ? colourOf(sampleBicubic(copied_, l.u, l.v)) : cv::Vec3f(), part);
    };
    for (const LikePlace& like : like_) {
      if (layers.open == 0.0f) return;
      if (lacksLike(triangle, w)) break;
      const Sighting l = lookAtShape(like.of(place));
      const float good = smoothStep(kPoor, kGood, l.weight);
      add(l, good > 0.0f ? good * sightings_.asOpen(0, l, place) : 0.0f);
    }
    const float flat = std::min(1.0f, std::cbrt(total) / kEnough);
    layers.add(own, flat * flat);
    const Sighting front = sightings_.frontBefore(keyPlaceOf(triangle, w));
    add(front, smoothStep(0.0f, kGood, front.weight));
  }

  // A detail, and what is beside one: the place's mirror image has none.
  bool lacksLike(int triangle, const Eigen::Vector3f& w) const {
    return isDetail(surface_, triangle) || showsMark(beside_details_, pictures_[0].region.tl(),
                                                     views_[0]->camera, keyPlaceOf(triangle, w));
  }

  const std::vector<const View*>& views_;
  const std::vector<const Actor*>& actors_;
  const std::vector<Reflectance>& pictures_;
  const Surface& surface_;
  const Sightings sightings_;
  // Where likenesses are the stock model's: its normals, and from it to the key frame's shape.
  Points stock_normals_;
  std::optional<BentShape> bent_;
  std::vector<Looks> looks_;     // per triangle
  cv::Mat beside_details_;       // besideDetails() of the key frame's picture
  std::vector<LikePlace> like_;  // best first; none before findLike()
  // Per picture, CV_32FC4: the reflectance that the texture is made of; the key frame's as like
  // places take it.
  std::vector<cv::Mat> shown_;
  cv::Mat copied_;
};

}  // namespace

void fillTexture(const SeenObject& object, Appearance& a) { TextureFill(object).run(a); }

}  // namespace calipso::render

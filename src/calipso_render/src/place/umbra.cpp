#include "place/umbra.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"

namespace calipso::render {
namespace {

constexpr int kStride = 2;           // px between the places that are looked at
constexpr int kBeside = 5;           // px beside an object's mask that may show it
constexpr int kFewestFrames = 3;     // in which a place must have been seen
constexpr float kQuiet = 5.0f;       // code values of spread over time: it rests
constexpr float kFullShade = 0.05f;  // of the sun
constexpr float kMostSun = 0.15f;    // of it in a shadow of one picture
constexpr float kFullSun = 0.9f;     // but for the objects
constexpr float kOpenSky = 0.4f;     // less of it is seen along contacts, where the dark is another
constexpr float kDark = 0.01f;       // linear; what is darker says nothing of its shadow
constexpr float kDarkest = 0.1f;     // the least that is left
constexpr std::size_t kFewest = 50;  // spots that tell
constexpr float kNoShadow = 0.85f;   // hardly darker: the shadow was not where it was predicted
constexpr float kRange = 1.5f;       // from the dark to the bright spots that tell gloss
constexpr int kEdge = 4;             // px: where planes meet

template <typename Spots, typename Value>
std::optional<float> median(const Spots& spots, Value value) {
  std::vector<float> values;
  for (const ShadedSpot& s : spots) {
    if (const std::optional<float> x = value(s)) values.push_back(*x);
  }
  if (values.size() < kFewest) return std::nullopt;
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

cv::Vec3f linear(const cv::Vec3f& code) {
  return {linearFromRealCode(code[0]), linearFromRealCode(code[1]), linearFromRealCode(code[2])};
}

// Sun over ambient light that a surface facing so gets.
float sunShare(const Light& light, const Eigen::Vector3f& normal) {
  const float shaded = luminance(diffuseShading(light, normal, 0.0f)),
              lit = luminance(diffuseShading(light, normal, 1.0f));
  return (lit - shaded) / std::max(shaded, 1e-4f);
}

// An umbra of that luminance: `umbra` times as dark, or in so much more light.
cv::Vec3f inHueOf(const cv::Vec3f& umbra, float wanted) {
  const float own = luminance(umbra);
  if (wanted <= own) return umbra * (wanted / own);
  const cv::Vec3f all(1, 1, 1);
  return all - (all - umbra) * ((1.0f - wanted) / (1.0f - own));
}

cv::Vec4b levels(const cv::Vec3f& umbra) {
  const auto level = [](float x) { return cv::saturate_cast<std::uint8_t>(255.0f * x); };
  return {level(umbra[0]), level(umbra[1]), level(umbra[2]), level(luminance(umbra))};
}

// What a view shows of a place; nullopt: nothing, or an object.
std::optional<cv::Vec3f> codeOf(const View& view, const cv::Mat& covered,
                                const Eigen::Vector3f& place) {
  const Eigen::Vector3d p = view.camera.world_from_camera.inverse() * place.cast<double>();
  if (p.z() <= 0.0) return std::nullopt;
  const Eigen::Vector2d at = view.camera.project(p);
  if (!(at.x() >= 0.0 && at.y() >= 0.0 && at.x() < covered.cols - 1 && at.y() < covered.rows - 1))
    return std::nullopt;
  const int u = static_cast<int>(at.x()), v = static_cast<int>(at.y());
  if (covered.at<std::uint8_t>(v, u) != 0) return std::nullopt;
  const float right = static_cast<float>(at.x()) - u, down = static_cast<float>(at.y()) - v;
  return (1.0f - down) * ((1.0f - right) * view.codeAt(v, u) + right * view.codeAt(v, u + 1)) +
         down * ((1.0f - right) * view.codeAt(v + 1, u) + right * view.codeAt(v + 1, u + 1));
}

}  // namespace

std::vector<ShadedSpot> shadedInPicture(const cv::Mat& picture, const cv::Mat& plate,
                                        const cv::Mat& sun, const cv::Mat& sky,
                                        const cv::Mat& unknown) {
  std::vector<ShadedSpot> spots;
  for (int v = 0; v < picture.rows; ++v) {
    for (int u = 0; u < picture.cols; ++u) {
      const float open = sky.at<float>(v, u);
      if (sun.at<float>(v, u) > kMostSun || open < kOpenSky || unknown.at<std::uint8_t>(v, u) != 0)
        continue;
      spots.push_back({{u, v},
                       linear(plate.at<cv::Vec3f>(v, u)),
                       linear(picture.at<cv::Vec3f>(v, u)) * (1.0f / skyLight(open))});
    }
  }
  return spots;
}

SeenUmbra umbraAt(const std::vector<ShadedSpot>& spots) {
  cv::Vec3f umbra;
  int undarkened = 0;
  for (int c = 0; c < 3; ++c) {
    const auto ratio = median(spots, [c](const ShadedSpot& s) {
      return s.lit[c] > kDark ? std::optional(s.shaded[c] / s.lit[c]) : std::nullopt;
    });
    if (!ratio) return {};
    umbra[c] = std::max(*ratio, kDarkest);
    undarkened += *ratio > kNoShadow;
  }
  if (undarkened > 0) return {std::nullopt, undarkened == 3};
  return {umbra, false};
}

cv::Vec3f PlaneUmbra::at(const cv::Vec3f& lit) const {
  cv::Vec3f left = part;
  for (int c = 0; c < 3 && gloss > 0.0f; ++c)
    left[c] = std::min(part[c] + gloss / std::max(lit[c], kDark), 1.0f);
  return left;
}

// In each colour a line through the medians of the darkest and the brightest third (Tukey 1977)
// leaves what mirrors no more than that at black; gloss has no hue, so the least of them counts.
std::optional<PlaneUmbra> glossyUmbra(const std::vector<ShadedSpot>& spots) {
  PlaneUmbra found{{}, 1.0f};
  for (int c = 0; c < 3; ++c) {
    std::vector<ShadedSpot> sorted = spots;
    std::sort(sorted.begin(), sorted.end(),
              [c](const ShadedSpot& a, const ShadedSpot& b) { return a.lit[c] < b.lit[c]; });
    const std::ptrdiff_t third = sorted.size() / 3;
    const auto middle = [&](auto begin, const auto& member) {
      return median(std::vector<ShadedSpot>(begin, begin + third),
                    [&](const ShadedSpot& s) { return std::optional((s.*member)[c]); });
    };
    const auto dark = middle(sorted.begin(), &ShadedSpot::lit),
               bright = middle(sorted.end() - third, &ShadedSpot::lit),
               shaded_dark = middle(sorted.begin(), &ShadedSpot::shaded),
               shaded_bright = middle(sorted.end() - third, &ShadedSpot::shaded);
    if (!dark || *bright < kRange * std::max(*dark, kDark)) return std::nullopt;
    const float rise = (*shaded_bright - *shaded_dark) / (*bright - *dark);
    found.gloss = std::min(found.gloss, *shaded_dark - rise * *dark);
  }
  if (found.gloss <= 0.0f) return std::nullopt;
  std::vector<ShadedSpot> matt = spots;
  for (ShadedSpot& s : matt) s.shaded -= cv::Vec3f::all(found.gloss);
  const auto part = umbraAt(matt).umbra;
  if (!part) return std::nullopt;
  found.part = *part;
  return found;
}

UmbraSurfaces::UmbraSurfaces(const std::vector<SupportPlane>& planes, const Relief& relief,
                             const Camera& camera)
    : numbers_(cv::Mat::zeros(camera.height, camera.width, CV_8U)),
      planes_(planes),
      relief_(relief) {
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const auto seen = receiverAt(planes, camera, u, v);
      if (!seen || relief.at(u, v)) continue;
      const auto off = [&](const SupportPlane& p) {
        return (p.normal.cast<float>() - seen->normal).norm() +
               std::abs(p.normal.dot(seen->position.cast<double>()) - p.offset);
      };
      const auto nearer = [&](const auto& a, const auto& b) { return off(a) < off(b); };
      numbers_.at<std::uint8_t>(v, u) =
          1 + (std::min_element(planes.begin(), planes.end(), nearer) - planes.begin());
    }
  }
}

std::vector<ShadedSpot> UmbraSurfaces::onSupports(const std::vector<ShadedSpot>& spots) const {
  std::vector<ShadedSpot> on;
  std::copy_if(spots.begin(), spots.end(), std::back_inserter(on),
               [this](const ShadedSpot& s) { return numbers_.at<std::uint8_t>(s.at) != 0; });
  return on;
}

std::vector<ShadedSpot> UmbraSurfaces::shadedInViews(const std::vector<View>& views,
                                                     const ReceiverOf& receiver,
                                                     const Background& seen, const Light& light,
                                                     const Visibility& unseen) const {
  std::vector<ShadedSpot> spots;
  if (planes_.empty() || seen.count.empty()) return spots;
  for (const View& view : views) {
    const std::vector<Occluder> occluders = occludersOf(view.actors);
    const ShadowMap sun(occluders, light.direction.cast<double>(), {512, light.angular_radius, 16});
    const SkyMap sky(occluders, planes_.front().normal, {});
    cv::Mat covered;
    cv::dilate(view.labels != 0, covered, cv::Mat::ones(2 * kBeside + 1, 2 * kBeside + 1, CV_8U));
    for (int v = 0; v < numbers_.rows; v += kStride) {
      for (int u = 0; u < numbers_.cols; u += kStride) {
        if (seen.count.at<std::uint8_t>(v, u) < kFewestFrames ||
            seen.spread.at<float>(v, u) >= kQuiet)
          continue;
        const auto r = receiver(u, v);
        if (!r || sun.visibility(r->position, r->normal) > kFullShade ||
            unseen.visibility(r->position, r->normal) < kFullSun)
          continue;
        const float open = relief_.at(u, v) ? 1.0f : sky.visibility(r->position, r->normal);
        const auto code = codeOf(view, covered, r->position);
        if (open < kOpenSky || !code) continue;
        spots.push_back({{u, v},
                         linear(seen.plate.at<cv::Vec3f>(v, u)),
                         linear(*code) * (1.0f / skyLight(open))});
      }
    }
  }
  return spots;
}

// Of each plane.
std::vector<PlaneUmbra> UmbraSurfaces::planesUmbras(const std::vector<ShadedSpot>& spots,
                                                    bool seen_lit, const cv::Vec3f& shared) const {
  std::vector<std::vector<ShadedSpot>> of(planes_.size());
  for (const ShadedSpot& s : onSupports(spots))
    of[numbers_.at<std::uint8_t>(s.at) - 1].push_back(s);
  std::vector<PlaneUmbra> umbras;
  for (const std::vector<ShadedSpot>& own : of) {
    const auto umbra = umbraAt(own).umbra;
    const auto glossy = umbra && seen_lit ? glossyUmbra(own) : std::nullopt;
    umbras.push_back(glossy.value_or(PlaneUmbra{umbra.value_or(shared)}));
  }
  return umbras;
}

cv::Mat UmbraSurfaces::umbra(const std::vector<ShadedSpot>& spots, bool seen_lit,
                             const cv::Vec3f& shared, const Light& light,
                             const cv::Mat& plate) const {
  std::vector<ShadedSpot> on_relief;
  std::copy_if(spots.begin(), spots.end(), std::back_inserter(on_relief),
               [this](const ShadedSpot& s) { return relief_.at(s.at.x, s.at.y); });
  const float scale = scaleOnRelief(on_relief, luminance(shared), light);
  cv::Mat out(numbers_.size(), CV_8UC4, levels(shared));
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u) {
      if (!relief_.at(u, v)) continue;
      const float sun = scale * sunShare(light, relief_.receiver(u, v).normal);
      out.at<cv::Vec4b>(v, u) = levels(inHueOf(shared, 1.0f / (1.0f + sun)));
    }
  }
  // Which of two planes is seen where they meet is not sure: a line brighter than the shade of both
  // would stand out.
  out.setTo(cv::Scalar::all(255), numbers_);
  const std::vector<PlaneUmbra> umbras = planesUmbras(spots, seen_lit, shared);
  for (std::size_t k = 0; k < umbras.size(); ++k) {
    cv::Mat near;
    cv::dilate(numbers_ == k + 1, near, cv::Mat::ones(2 * kEdge + 1, 2 * kEdge + 1, CV_8U));
    near &= numbers_ != 0;
    for (int v = 0; v < out.rows; ++v) {
      for (int u = 0; u < out.cols; ++u) {
        if (near.at<std::uint8_t>(v, u) == 0) continue;
        cv::Vec4b& at = out.at<cv::Vec4b>(v, u);
        const cv::Vec4b own = levels(umbras[k].at(plate.at<cv::Vec3f>(v, u)));
        for (int c = 0; c < 4; ++c) at[c] = std::min(at[c], own[c]);
      }
    }
  }
  return out;
}

// Of the sun's share, seen over what the light predicts.
float UmbraSurfaces::scaleOnRelief(const std::vector<ShadedSpot>& on_relief, float shared,
                                   const Light& light) const {
  const auto seen = median(on_relief, [&](const ShadedSpot& s) -> std::optional<float> {
    const float lit = luminance(s.lit),
                share = sunShare(light, relief_.receiver(s.at.x, s.at.y).normal);
    if (lit < kDark || share <= 0.0f) return std::nullopt;
    const float left = std::clamp(luminance(s.shaded) / lit, 0.05f, 1.0f);
    return (1.0f / left - 1.0f) / share;
  });
  if (seen && *seen > 1.0f / kNoShadow - 1.0f) return *seen;
  const float of_planes =
      sunShare(light, planes_.empty() ? Eigen::Vector3f::UnitZ()
                                      : Eigen::Vector3f(planes_.front().normal.cast<float>()));
  return of_planes > 0.0f ? (1.0f / shared - 1.0f) / of_planes : 1.0f;
}

cv::Vec3f umbraOfPassing(const std::vector<ClipFrame>& frames,
                         const std::vector<SupportPlane>& planes, const Background& background,
                         const cv::Vec3f& predicted) {
  std::vector<float> ratios[3];
  for (const ClipFrame& f : frames) {
    cv::Mat covered;
    cv::dilate(f.labels != 0, covered, cv::Mat::ones(11, 11, CV_8U));
    for (int v = 0; v < f.bgr.rows; v += 2) {
      for (int u = 0; u < f.bgr.cols; u += 2) {
        const bool quiet =
            background.count.at<std::uint8_t>(v, u) > 2 && background.spread.at<float>(v, u) < 5.0f;
        if (!quiet || covered.at<std::uint8_t>(v, u) != 0) continue;
        float ratio[3];
        for (int c = 0; c < 3; ++c) {
          const float lit = linearFromRealCode(background.plate.at<cv::Vec3f>(v, u)[c]);
          ratio[c] = linearFromCode(f.bgr.at<cv::Vec3b>(v, u)[c]) / std::max(lit, 0.004f);
        }
        if (std::max({ratio[0], ratio[1], ratio[2]}) > 0.8f || !receiverAt(planes, f.camera, u, v))
          continue;
        for (int c = 0; c < 3; ++c) ratios[c].push_back(ratio[c]);
      }
    }
  }
  if (ratios[0].size() < 100) return predicted;
  cv::Vec3f umbra;
  for (int c = 0; c < 3; ++c) {
    std::nth_element(ratios[c].begin(), ratios[c].begin() + ratios[c].size() / 3, ratios[c].end());
    umbra[c] = std::clamp(ratios[c][ratios[c].size() / 3], 0.1f, 0.95f);
  }
  return umbra;
}

cv::Vec3f predictedUmbra(const Light& light, const std::vector<SupportPlane>& planes) {
  const Eigen::Vector3f n = planes.empty() ? Eigen::Vector3f(Eigen::Vector3f::UnitZ())
                                           : planes.front().normal.cast<float>();
  const cv::Vec3f shaded = diffuseShading(light, n, 0.0f), lit = diffuseShading(light, n, 1.0f);
  cv::Vec3f umbra;
  for (int c = 0; c < 3; ++c)
    umbra[c] = std::clamp(shaded[c] / std::max(lit[c], 1e-4f), 0.1f, 0.95f);
  return umbra;
}

}  // namespace calipso::render

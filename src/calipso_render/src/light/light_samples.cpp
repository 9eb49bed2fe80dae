#include <algorithm>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/light_fit.hpp"
#include "draw/ray_scene.hpp"
#include "draw/side_by_side.hpp"
#include "light/gloss_fit.hpp"
#include "light/shadow_clue.hpp"
#include "light/shadow_contrast.hpp"

namespace calipso::render {
namespace {

constexpr std::size_t kPerObject = 1500;  // samples at most
constexpr int kRim = 3;                   // px of the mask's rim that are left out
constexpr float kSaturated = 250.0f;      // code value
constexpr int kClustersPerObject = 4;
// cosine to the viewer; flatter ones mirror more than the model knows
constexpr float kGrazingView = 0.25f;
constexpr int kBelowStep = 4, kFewestBelow = 100;  // px, places: of what lies below the objects
constexpr int kBesideStep = 2,
              kBeside = 40;         // px, and up to how many from the objects: beside them
constexpr float kAround = 3.0f;     // of the objects' extent, in which it is looked at
constexpr double kDarkest = 0.005;  // linear; darker has no colour

struct Pixel {
  int u, v;
};

// Pixels well inside the object's mask that its surface covers, thinned evenly.
std::vector<Pixel> usablePixels(const VisibilityBuffer& buffer, const View& view,
                                const cv::Mat& inside, std::size_t limit) {
  std::vector<Pixel> pixels;
  const cv::Rect& r = buffer.region();
  for (int v = 0; v < r.height; ++v) {
    for (int u = 0; u < r.width; ++u) {
      if (buffer.ids(v)[u] == VisibilityBuffer::kNothing ||
          inside.at<std::uint8_t>(v + r.y, u + r.x) == 0)
        continue;
      const cv::Vec3f x = view.codeAt(v + r.y, u + r.x);
      if (std::max({x[0], x[1], x[2]}) < kSaturated) pixels.push_back({u + r.x, v + r.y});
    }
  }
  const std::size_t step = std::max<std::size_t>(1, pixels.size() / limit);
  std::vector<Pixel> thinned;
  for (std::size_t i = 0; i < pixels.size(); i += step) thinned.push_back(pixels[i]);
  return thinned;
}

// Colour without brightness, which shading changes: the darker, the more like grey. All greys are
// one, whatever rounding makes of them.
cv::Vec2f chromaticity(const cv::Vec3f& radiance) {
  constexpr float kDark = 0.01f, kStep = 1e-4f;
  const float sum = radiance[0] + radiance[1] + radiance[2] + kDark;
  const auto part = [&](int c) {
    return kStep * std::round((radiance[c] + kDark / 3.0f) / (kStep * sum));
  };
  return {part(0), part(2)};
}

// Cluster of each sample, 0-based; returns how many there are.
int clusterByColour(std::vector<LightSample>& samples, std::size_t first, int base) {
  const int count = static_cast<int>(samples.size() - first);
  if (count < 8 * kClustersPerObject) return count > 0 ? 1 : 0;
  cv::Mat points(count, 1, CV_32FC2), labels;
  for (int i = 0; i < count; ++i)
    points.at<cv::Vec2f>(i) = chromaticity(samples[first + i].radiance);
  cv::theRNG().state = 1;  // k-means draws its starts from the shared generator
  cv::kmeans(points, kClustersPerObject, labels,
             {cv::TermCriteria::MAX_ITER | cv::TermCriteria::EPS, 20, 1e-4}, 2,
             cv::KMEANS_PP_CENTERS);
  for (int i = 0; i < count; ++i) samples[first + i].cluster = base + labels.at<int>(i);
  return kClustersPerObject;
}

void sampleView(const View& view, int picture, std::size_t object, std::size_t limit,
                std::vector<LightSample>& samples) {
  const Actor& actor = view.actors[object];
  const Eigen::Vector3f eye = view.camera.world_from_camera.translation().cast<float>();
  const VisibilityBuffer buffer(boundsOf(actor.screen, 0, view.picture.size()), {&actor.screen});
  cv::Mat inside;
  cv::erode(view.labels == actor.surface->index, inside,
            cv::Mat::ones(2 * kRim + 1, 2 * kRim + 1, CV_8U));
  for (const Pixel& p : usablePixels(buffer, view, inside, limit)) {
    const int triangle = VisibilityBuffer::triangleOf(buffer.idAt(p.u, p.v));
    const SurfacePoint s = surfacePoint(actor, triangle, p.u, p.v, eye);
    const Eigen::Vector3f towards = (eye - s.position).normalized();
    if (s.normal.dot(towards) < kGrazingView) continue;
    LightSample sample{s.position, s.normal, towards, {}, 0, s.seen, picture};
    const cv::Vec3f code = view.codeAt(p.v, p.u);
    for (int c = 0; c < 3; ++c) sample.radiance[c] = linearFromRealCode(code[c]);
    samples.push_back(sample);
  }
}

// LightEvidence's `below`: the support planes around the objects.
void lookBelow(const View& view, const std::vector<SupportPlane>& planes, LightEvidence& evidence) {
  Eigen::AlignedBox3f box;
  for (const Actor& a : view.actors) {
    for (const Eigen::Vector3f& p : a.vertices) box.extend(p);
  }
  cv::Vec3d sum;
  int count = 0;
  for (int v = 0; v < view.picture.rows && !box.isEmpty(); v += kBelowStep) {
    for (int u = 0; u < view.picture.cols; u += kBelowStep) {
      if (view.labels.at<std::uint8_t>(v, u) != 0) continue;
      const auto receiver = receiverAt(planes, view.camera, u, v);
      if (!receiver || (receiver->position - box.center()).norm() > kAround * box.diagonal().norm())
        continue;
      const cv::Vec3f code = view.codeAt(v, u);
      for (int c = 0; c < 3; ++c) sum[c] += linearFromRealCode(code[c]);
      ++count;
    }
  }
  const double mean = (sum[0] + sum[1] + sum[2]) / 3.0;
  if (count < kFewestBelow || !(mean > kDarkest * count)) return;
  evidence.below = cv::Vec3f(sum / mean);
  evidence.below_brightness = static_cast<float>(mean / count);
}

// LightEvidence's `behind`.
void lookBehind(const View& view, LightEvidence& evidence) {
  const cv::Mat objects = view.labels != 0;
  cv::Mat beside;
  cv::dilate(objects, beside, cv::Mat::ones(2 * kBeside + 1, 2 * kBeside + 1, CV_8U));
  beside.setTo(0, objects);
  cv::Vec3d sum;
  int count = 0;
  for (int v = 0; v < beside.rows; v += kBesideStep) {
    for (int u = 0; u < beside.cols; u += kBesideStep) {
      if (beside.at<std::uint8_t>(v, u) == 0) continue;
      const cv::Vec3f code = view.codeAt(v, u);
      for (int c = 0; c < 3; ++c) sum[c] += linearFromRealCode(code[c]);
      ++count;
    }
  }
  if (count > 0) evidence.behind = cv::Vec3f(sum / count);
}

// @param which of its objects, one for each
RayScene sceneOf(const View& view, const std::vector<bool>& which) {
  std::vector<Occluder> occluders;
  for (std::size_t i = 0; i < view.actors.size(); ++i) {
    const Actor& a = view.actors[i];
    if (which[i]) occluders.push_back({&a.vertices, &a.surface->triangles, a.surface->winding});
  }
  return RayScene(occluders);
}

std::vector<RayScene> scenesOf(const std::vector<View>& views, const std::vector<bool>& which) {
  std::vector<RayScene> scenes;
  for (const View& view : views) scenes.push_back(sceneOf(view, which));
  return scenes;
}

// What tells shadows of what leaves its place, against the place without them where that is known;
// and of others by their outlines in the key frame.
struct Shadows {
  std::unique_ptr<ShadowContrast> coarse, fine;
  std::unique_ptr<ShadowClue> passing;  // none: nothing leaves
  // all of each view; those that leave; the key frame's others
  std::vector<RayScene> objects, leaving, staying;

  bool anyPass() const { return passing != nullptr && passing->plateKnown(); }
};

void addShadows(const std::shared_ptr<const Shadows>& seen, LightEvidence& evidence) {
  evidence.shadow_candidates = seen->coarse->candidates(seen->objects.front());
  if (!seen->anyPass()) {
    evidence.shadow_misfit = [seen](const Eigen::Vector3f& l) {
      return seen->fine->misfit(seen->objects.front(), l);
    };
    return;
  }
  const std::vector<Eigen::Vector3f> more = seen->passing->candidates();
  evidence.shadow_candidates.insert(evidence.shadow_candidates.end(), more.begin(), more.end());
  evidence.shadow_misfit = [seen](const Eigen::Vector3f& l) {
    return seen->fine->misfit(seen->staying.front(), l) + seen->passing->misfit(seen->leaving, l);
  };
}

}  // namespace

std::vector<LightSample> lightSamples(const std::vector<View>& views,
                                      const std::vector<bool>& moves, int& clusters) {
  std::vector<LightSample> samples;
  const std::vector<bool> anew = shownAnew(views, moves);
  clusters = 0;
  for (std::size_t object = 0; object < moves.size(); ++object) {
    const std::size_t first = samples.size();
    const std::size_t pictures = anew[object] ? views.size() : 1;
    for (std::size_t i = 0; i < pictures; ++i)
      sampleView(views[i], static_cast<int>(i), object, kPerObject / pictures, samples);
    for (std::size_t i = first; i < samples.size(); ++i) samples[i].cluster = clusters;
    clusters += clusterByColour(samples, first, clusters);
  }
  return samples;
}

LightEvidence lightEvidence(const std::vector<View>& views, const std::vector<bool>& moves,
                            const std::vector<SupportPlane>& planes, const Background& plate,
                            const cv::Mat& depth) {
  LightEvidence evidence;
  const auto seen = std::make_shared<Shadows>();
  const View& key = views.front();
  const std::vector<bool> leave = leavers(key, moves, plate);
  const bool any_leaves = std::find(leave.begin(), leave.end(), true) != leave.end();
  cv::Mat behind = depth.clone();
  if (!behind.empty()) behind.setTo(0.0f, key.labels != 0);
  const auto contrastBy = [&](int cells) {
    return std::make_unique<ShadowContrast>(key, planes, depth, cells);
  };
  doAll(true, {[&] {
                 if (any_leaves)
                   seen->passing = std::make_unique<ShadowClue>(
                       views, leave, planes, EmptyPlace{key.camera, plate, behind});
               },
               [&] {
                 evidence.samples = lightSamples(views, moves, evidence.clusters);
                 lookBelow(key, planes, evidence);
                 lookBehind(key, evidence);
               },
               [&] { seen->fine = contrastBy(ShadowContrast::kFine); },
               [&] {
                 seen->objects = scenesOf(views, std::vector<bool>(moves.size(), true));
                 if (!any_leaves) return;
                 seen->leaving = scenesOf(views, leave);
                 std::vector<bool> stay = leave;
                 stay.flip();
                 seen->staying.push_back(sceneOf(key, stay));
               },
               [&] { seen->coarse = contrastBy(ShadowContrast::kCoarse); }});
  evidence.visible = [seen](const LightSample& s, const Eigen::Vector3f& l) {
    return seen->objects[s.picture].blocked(s.position, s.normal, l) ? 0.0f : 1.0f;
  };
  addShadows(seen, evidence);
  evidence.gloss = [&views, anew = shownAnew(views, moves)](const LightFit& fit,
                                                            const LightEvidence& all) {
    return seenGlosses(highlightSamples(views, anew, all.samples, fit.light.direction), anew.size(),
                       fit, all.visible);
  };
  return evidence;
}

}  // namespace calipso::render

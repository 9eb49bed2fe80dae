#include <algorithm>
#include <chrono>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "calipso_render/clip_poses.hpp"
#include "calipso_render/renderer.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"
#include "frame/edge_blur.hpp"
#include "light/light_pictures.hpp"
#include "light/shadow_borders.hpp"
#include "model_details.hpp"
#include "place/blank_frames.hpp"
#include "place/clip_motion.hpp"
#include "place/exposure.hpp"
#include "place/key_cover.hpp"
#include "place/mended_depth.hpp"
#include "place/place_depth.hpp"
#include "place/plate_beside.hpp"
#include "prepare_background.hpp"
#include "prepare_remarks.hpp"
#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

// beside the key frame: those that tell the light, and that show the objects' reflectance
constexpr std::size_t kLightViews = 5;
constexpr std::size_t kTextureViews = 15;
constexpr float kUmbra =
    0.1f;  // visible part of the sun up to which, and missing from which, it is clear
constexpr int kMixed = 2;  // px around a moving object whose colour is mixed

std::vector<Actor> keyActors(const Prepared& p) {
  std::vector<Actor> actors;
  for (const Surface& s : p.surfaces) actors.push_back(makeActor(s, s.key_vertices, p.camera));
  return actors;
}

// The key frame, and up to kTextureViews further frames in which the poses of all moving objects are
// known, evenly spaced: where something moves, or the camera.
std::vector<View> viewsOf(const ClipSample& clip, const Prepared& p, const cv::Mat& key_picture) {
  std::vector<View> views = {{key_picture, p.key_labels, p.camera, keyActors(p)}};
  std::vector<const ClipFrame*> usable;
  for (std::size_t i = 1; i < clip.frames().size(); ++i) {
    const ClipFrame& f = clip.frames()[i];
    const auto known = [&](const Surface& s) {
      return std::any_of(f.poses.begin(), f.poses.end(),
                         [&](const ObjectPose& o) { return o.index == s.index; });
    };
    bool all = p.camera_moves || !f.poses.empty();
    for (std::size_t k = 0; k < p.surfaces.size(); ++k)
      all = all && (!p.moves[k] || known(p.surfaces[k]));
    if (all) usable.push_back(&f);
  }
  const std::size_t count = std::min(usable.size(), kTextureViews);
  views.resize(1 + count);
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t i = 0; i < count; ++i) {
    const ClipFrame& f = *usable[(i + 1) * usable.size() / count - 1];
    View& view = views[1 + i];
    view.picture = f.bgr, view.labels = f.labels, view.camera = f.camera;
    for (std::size_t k = 0; k < p.surfaces.size(); ++k) {
      const Surface& s = p.surfaces[k];
      Points vertices = s.key_vertices;
      for (const ObjectPose& o : f.poses) {
        if (p.moves[k] && o.index == s.index)
          vertices = transformed(s.object_vertices, o.world_from_object);
      }
      view.actors.push_back(makeActor(s, std::move(vertices), f.camera));
    }
  }
  return views;
}

// The key frame's view and up to kLightViews others, evenly spaced.
std::vector<View> lightViewsOf(const std::vector<View>& views) {
  std::vector<View> some = {views.front()};
  const std::size_t further = views.size() - 1, count = std::min(further, kLightViews);
  for (std::size_t i = 0; i < count; ++i) some.push_back(views[(i + 1) * further / count]);
  return some;
}

class Stopwatch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
    return ms;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

void checkInput(const ClipSample& clip, const RenderParams& params) {
  if (clip.frames().empty())
    throw std::invalid_argument(
        "no clip frame with a segmentation has arrived; send the key frame first");
  if (!params.depth.empty() && params.depth.size() != clip.frames().front().bgr.size()) {
    throw std::invalid_argument(
        "the depth image is not of the key frame's size; scale it or leave it out");
  }
}

void findSurfacesInClip(const ClipSample& clip, const std::vector<ObjectModel>& models,
                        Prepared& p) {
  const ClipFrame& key = clip.frames().front();
  p.camera = key.camera, p.key_stamp_ns = key.stamp_ns;
  p.key_picture = key.bgr, p.key_labels = key.labels;
  p.camera_moves = cameraMoves(clip);
  for (const ObjectModel& m : models) {
    p.surfaces.push_back(makeSurface(m));
    p.moves.push_back(movesInVideo(clip.frames(), p.surfaces.back()));
    p.sways.push_back(!p.moves.back() && !p.camera_moves && swaysInVideo(clip.frames(), m.index));
  }
}

// What rests is where it was in the key frame, also where a later mask misses it.
void coverWhatRests(const Prepared& p, std::vector<ClipFrame>& frames) {
  for (std::size_t i = 0; i < p.surfaces.size(); ++i) {
    if (p.moves[i] || p.sways[i]) continue;
    const cv::Mat covered = p.key_labels == p.surfaces[i].index;
    for (ClipFrame& f : frames) {
      f.labels = f.labels.clone();  // the clip keeps its own
      f.labels.setTo(p.surfaces[i].index, covered & (f.labels == 0));
    }
  }
}

// Which of them are cloth: sheets that lie about in a plane, as no boat's thin hull does.
std::vector<bool> clothAmong(const std::vector<Surface>& surfaces) {
  constexpr float kFlat = 0.15f;  // least to greatest extent
  std::vector<bool> cloth;
  for (const Surface& s : surfaces)
    cloth.push_back(isSheet(s.key_vertices, s.triangles) && flatness(s.key_vertices) < kFlat);
  return cloth;
}

Eigen::Vector3f lookingDirection(const Prepared& p) {
  return -p.camera.world_from_camera.linear().col(2).cast<float>();
}

// @param seen used if any object moves
LightPictures lightPictures(const std::vector<View>& views, const Background& seen, bool any_moves,
                            const RenderParams& params, const Prepared& p) {
  return atWorkingSize(
      {lightViewsOf(views), any_moves ? seen : Background(), params.depth, p.outline_blur});
}

LightFit lightOf(const LightPictures& pictures, const RenderParams& params, const Prepared& p) {
  LightEvidence evidence =
      lightEvidence(pictures.views, p.moves, params.planes, pictures.plate, pictures.depth);
  evidence.borders = [&](const Eigen::Vector3f& l) {
    return sunByBorders(pictures.views, params.planes, pictures.depth, l, pictures.blur);
  };
  LightFit fit = fitLight(evidence, params.up.cast<float>(), lookingDirection(p));
  fit.light.angular_radius = static_cast<float>(params.sun_radius);
  if (fit.by_borders) {
    fit.light.direction = fit.by_borders->direction;
    fit.light.angular_radius = fit.by_borders->radius.value_or(fit.light.angular_radius);
  }
  return fit;
}

// The light that explains the objects past what else keeps the sun off them.
LightFit lightPastUnseen(const LightPictures& pictures, const RenderParams& params,
                         const Prepared& p) {
  LightEvidence evidence =
      lightEvidence(pictures.views, p.moves, params.planes, {}, pictures.depth);
  evidence.known_sun = p.light.light.direction;
  const auto clear = [&](const LightSample& s) {
    const float sun = p.unseen_shade.visibility(s.position, s.normal);
    return sun < kUmbra || sun > 1.0f - kUmbra;
  };
  auto& samples = evidence.samples;
  samples.erase(std::stable_partition(samples.begin(), samples.end(), clear), samples.end());
  evidence.visible = [&p, past_objects = evidence.visible](const LightSample& s,
                                                           const Eigen::Vector3f& l) {
    return past_objects(s, l) * p.unseen_shade.visibility(s.position, s.normal);
  };
  LightFit fit = fitLight(evidence, params.up.cast<float>(), lookingDirection(p));
  if (!fit.determined) return p.light;
  fit.by_borders = p.light.by_borders;
  fit.light.angular_radius = p.light.light.angular_radius;
  return fit;
}

// Light and objects again once that is known.
void learnPastUnseen(const std::vector<View>& views, const RenderParams& params, Prepared& p) {
  p.light = lightPastUnseen(lightPictures(views, {}, false, params, p), params, p);
  p.appearances =
      makeAppearances(views, p.moves, p.light.light, p.light.glosses(clothAmong(p.surfaces)),
                      params.planes, p.unseen_shade);
}

// Those that rest, if others move; none if none does, as then all are the same.
std::vector<Actor> restingAmong(const std::vector<Actor>& actors, const std::vector<bool>& moves) {
  std::vector<Actor> resting;
  for (std::size_t i = 0; i < actors.size(); ++i) {
    if (!moves[i]) resting.push_back(actors[i]);
  }
  return resting.size() < actors.size() ? resting : std::vector<Actor>();
}

ShadowMap sunOver(const std::vector<Actor>& actors, const Light& light) {
  return {occludersOf(actors), light.direction.cast<double>(), {768, light.angular_radius, 16}};
}

SkyMap skyOver(const std::vector<Actor>& actors, const RenderParams& params) {
  constexpr SkyMap::Params kFine{256};
  if (params.planes.empty()) return {{}, params.up, kFine};
  return {occludersOf(actors), params.planes.front().normal, kFine};
}

// CV_8UC1, 255: what moves or sways.
cv::Mat movingIn(const cv::Mat& labels, const Prepared& p) {
  cv::Mat moving = cv::Mat::zeros(labels.size(), CV_8U);
  for (std::size_t i = 0; i < p.surfaces.size(); ++i) {
    if (p.moves[i] || p.sways[i]) moving |= labels == p.surfaces[i].index;
  }
  return moving;
}

NoiseModel noiseOf(const std::vector<ClipFrame>& frames, const cv::Mat& steadiness,
                   const Prepared& p) {
  std::vector<cv::Mat> pictures, steady;
  for (const ClipFrame& f : frames) {
    cv::Mat moving = movingIn(f.labels, p);
    cv::dilate(moving, moving, cv::Mat::ones(2 * kMixed + 1, 2 * kMixed + 1, CV_8U));
    pictures.push_back(f.bgr), steady.push_back((steadiness > 1) & (moving == 0));
  }
  return NoiseModel::estimate(pictures, steady);
}

// How the objects lie in the key frame, and what is around them there.
void findOutlines(const std::vector<Actor>& actors, const cv::Mat& picture,
                  const RenderParams& params, Prepared& p) {
  for (const Actor& a : actors) p.outlines.push_back(outlineOf(a, p.key_labels.size()));
  p.fronts = frontsOf(p, params);
  p.footprints = footprintsOf(p, picture, params.background.mask_margin_px);
  p.scenery = sceneryOf(params.depth, p, params.background.mask_margin_px);
}

}  // namespace

Prepared prepare(const ClipSample& given_clip, const std::vector<ObjectModel>& models,
                 const RenderParams& given) {
  checkInput(given_clip, given);
  const std::optional<ClipSample> without_blanks = withoutBlankFrames(given_clip);
  const ClipSample& as_taken = without_blanks ? *without_blanks : given_clip;
  const std::optional<ClipSample> even = evenlyExposed(as_taken);
  const ClipSample& clip = even ? *even : as_taken;
  RenderParams params = given;
  const ClipFrame& key = clip.frames().front();
  params.depth = mendedDepth(given.depth, key.labels, given.planes, key.camera);
  Prepared p;
  findSurfacesInClip(clip, models, p);
  std::vector<ClipFrame> covered =
      p.camera_moves ? withOutlines(clip.frames(), p.surfaces, p.moves) : clip.frames();
  p.nearness = placeNearness(p.camera_moves ? covered : std::vector<ClipFrame>{covered.front()},
                             params.planes, params.depth, params.background.mask_margin_px);
  covered.front() = key;  // what stands before objects is seen there
  std::vector<ClipFrame> frames = inKeyView(covered, p.nearness, params.background.mask_margin_px);
  if (!p.camera_moves) coverWhatRests(p, frames);
  cv::Mat steadiness;
  const cv::Mat picture = steadyKeyFrame(frames, movingIn(frames.front().labels, p), steadiness);
  p.outline_blur = outlineBlur(picture, p.key_labels);
  p.colour_blur = colourBlur(picture, p.key_labels);
  const bool any_moves = std::find(p.moves.begin(), p.moves.end(), true) != p.moves.end();
  Stopwatch watch;
  Background seen = seenBackground(frames, any_moves, params.background);
  if (p.camera_moves) sharpenSeen(frames, params.background, seen);
  p.background_ms = watch.lap();
  std::vector<View> views = viewsOf(clip, p, picture);
  p.light = lightOf(lightPictures(views, seen, any_moves, params, p), params, p);
  if (addDetails(views.front(), params.depth, p.nearness, models, p.surfaces))
    views = viewsOf(clip, p, picture);
  const std::vector<View> light_views = lightViewsOf(views);
  const std::vector<Actor>& actors = views.front().actors;
  p.texture_views = static_cast<int>(views.size());
  p.light_views = static_cast<int>(light_views.size());
  // Where no cast shadow tells the light, the objects' shade on the ground may be another.
  p.appearances =
      makeAppearances(views, p.moves, p.light.light, p.light.glosses(clothAmong(p.surfaces)),
                      p.light.from_shadows ? params.planes : std::vector<SupportPlane>());
  p.appearance_ms = watch.lap();
  const ShadowMap sun = sunOver(actors, p.light.light);
  const SkyMap sky = skyOver(actors, params);
  const std::vector<Actor> resting = restingAmong(actors, p.moves);
  const ShadowMap sun_past_resting = sunOver(resting, p.light.light);
  const SkyMap sky_past_resting = skyOver(resting, params);
  findOutlines(actors, picture, params, p);
  prepareBackground({frames, light_views, actors, seen, picture, sun, sky, sun_past_resting,
                     sky_past_resting, p.camera_moves},
                    params, p);
  if (p.camera_moves && !p.background.drifting.established())
    p.beside = platesBeside(covered, p.nearness, any_moves, params.background);
  p.background_ms += watch.lap();
  if (!p.unseen_shade.empty()) learnPastUnseen(views, params, p);
  p.appearance_ms += watch.lap();
  p.noise = noiseOf(frames, steadiness, p);
  p.blank_frames = static_cast<int>(given_clip.frames().size() - clip.frames().size());
  addRemarks(clip.frames(), actors, p);
  return p;
}

}  // namespace calipso::render

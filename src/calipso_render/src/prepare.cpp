#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>

#include "calipso_render/clip_poses.hpp"
#include "calipso_render/colour.hpp"
#include "calipso_render/renderer.hpp"
#include "calipso_render/shadow_map.hpp"
#include "place_depth.hpp"
#include "place_relief.hpp"
#include "plane_mirror.hpp"
#include "prepare_remarks.hpp"
#include "shadow_check.hpp"
#include "umbra.hpp"
#include "view_warp.hpp"

namespace calipso::render {
namespace {

constexpr float kOpenSky =
    0.4f;  // ... above which the dark of a shadow says how dark the sun's absence is
// visible parts from which a place says how the planes mirror
constexpr float kUnshadedSun = 0.985f, kUnshadedSky = 0.85f;
// px; narrower gaps between mask and model are misfit, unless they reach
constexpr int kFrontOpening = 7;
constexpr int kNarrowFront = 3;     // ... so much of them
constexpr float kDeepFront = 6.0f;  // ... that far inside the model's outline: a peg on a towel
constexpr std::size_t kFurtherViews = 5;  // beside the key frame
constexpr float kNearerBeside = 1.02f;    // times as near: before an object
// part by which scenery is nearer or farther than the plane behind or before it
constexpr float kOffPlane = 0.1f;
constexpr double kStillOverlap = 0.93;  // masks of an object at rest overlap by more than this
constexpr int kSameCodes = 8;           // code values, mean over 3 x 3 pixels, that noise may make
// part of an object in which the picture changes by more if it sways
constexpr double kSwayed = 0.15;

// @param nearness of the place, from the key frame's camera
std::vector<ClipFrame> inKeyView(const ClipSample& clip, const cv::Mat& nearness) {
  std::vector<ClipFrame> frames = clip.frames();
  const Camera& key = frames.front().camera;
  for (ClipFrame& f : frames) {
    if (sameView(f.camera, key)) continue;
    const cv::Mat map = viewWarp(nearness, f.camera, key);
    cv::Mat bgr, labels;
    cv::remap(f.bgr, bgr, map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT);
    cv::remap(f.labels, labels, map, cv::noArray(), cv::INTER_NEAREST, cv::BORDER_CONSTANT,
              cv::Scalar(255));
    f = {bgr, labels, key};
  }
  return frames;
}

bool cameraMoves(const ClipSample& clip) {
  const Camera& key = clip.frames().front().camera;
  return std::any_of(clip.frames().begin(), clip.frames().end(),
                     [&](const ClipFrame& f) { return !sameView(f.camera, key); });
}

// CV_8UC1: 255 where the model covers the picture.
cv::Mat outlineOf(const Actor& actor, const cv::Size& size) {
  cv::Mat outline = cv::Mat::zeros(size, CV_8U);
  VisibilityBuffer buffer({0, 0, size.width, size.height});
  buffer.draw(actor.screen, 0);
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      if (buffer.ids(v)[u] != VisibilityBuffer::kNothing) outline.at<std::uint8_t>(v, u) = 255;
    }
  }
  return outline;
}

// Part that two masks share of what either covers.
double overlap(const cv::Mat& a, const cv::Mat& b) {
  const int either = cv::countNonZero(a | b);
  return either > 0 ? static_cast<double>(cv::countNonZero(a & b)) / either : 1.0;
}

cv::Mat outlineAtRest(const Surface& surface, const Camera& camera) {
  return outlineOf(makeActor(surface, surface.key_vertices, camera), {camera.width, camera.height});
}

// A moving camera sees an object at rest where its model at rest is, as well as they agree at the
// key frame.
// @param frames as they were taken
bool movesInVideo(const std::vector<ClipFrame>& frames, const Surface& surface) {
  const Camera& camera = frames.front().camera;
  const cv::Mat key = frames.front().labels == surface.index;
  std::optional<double> fit;
  for (const ClipFrame& f : frames) {
    const cv::Mat now = f.labels == surface.index;
    if (!sameView(f.camera, camera) && !fit) fit = overlap(key, outlineAtRest(surface, camera));
    const bool rests = sameView(f.camera, camera)
                           ? overlap(now, key) >= kStillOverlap
                           : overlap(now, outlineAtRest(surface, f.camera)) >= kStillOverlap * *fit;
    if (!rests) return true;
  }
  return false;
}

// What keeps its outline may yet bend within: then the picture of it changes.
bool swaysInVideo(const std::vector<ClipFrame>& frames, int index) {
  cv::Mat key_picture, picture, same;
  cv::blur(frames.front().bgr, key_picture, {3, 3});
  for (const ClipFrame& f : frames) {
    const cv::Mat both = (f.labels == index) & (frames.front().labels == index);
    cv::blur(f.bgr, picture, {3, 3});
    cv::absdiff(picture, key_picture, picture);
    cv::inRange(picture, cv::Scalar(), cv::Scalar::all(kSameCodes), same);
    if (cv::countNonZero(both & ~same) > kSwayed * cv::countNonZero(both)) return true;
  }
  return false;
}

// Where the depth image shows something else than a support plane.
cv::Mat offPlanes(const cv::Mat& scenery, const std::vector<SupportPlane>& planes,
                  const Camera& camera) {
  cv::Mat off = cv::Mat::zeros(camera.height, camera.width, CV_8U);
  const cv::Mat ground = scenery.empty() ? cv::Mat() : groundNearness(planes, camera, cv::Mat());
  if (!ground.empty())
    off = (scenery > 0.0f) &
          ((scenery > (1.0f + kOffPlane) * ground) | ((1.0f + kOffPlane) * scenery < ground));
  return off;
}

// Visibility of a light on the support planes and on the relief, 0..1, where one is seen; 1
// elsewhere.
cv::Mat placeVisibility(const ShadowMap& sun, const std::vector<SupportPlane>& planes,
                        const Relief& relief, const cv::Mat& off_planes, const ClipFrame& key) {
  cv::Mat visibility(key.bgr.size(), CV_32F, cv::Scalar(1.0f));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < visibility.rows; ++v) {
    for (int u = 0; u < visibility.cols; ++u) {
      if (off_planes.at<std::uint8_t>(v, u) != 0) continue;
      const std::optional<Receiver> receiver =
          relief.at(u, v) ? relief.receiver(u, v) : receiverAt(planes, key.camera, u, v);
      if (receiver)
        visibility.at<float>(v, u) = sun.visibility(receiver->position, receiver->normal);
    }
  }
  return visibility;
}

// Median of picture / plate per channel over pixels of the full shadow, where all of the sky would
// be seen; the light's own ratio if there are too few. @param sun, sky visible parts of them on the
// support planes
cv::Vec3f measureUmbra(const cv::Mat& picture, const cv::Mat& plate, const cv::Mat& sun,
                       const cv::Mat& sky, const cv::Mat& labels, const cv::Vec3f& predicted) {
  cv::Vec3f umbra = predicted;
  for (int c = 0; c < 3; ++c) {
    std::vector<float> ratios;
    for (int v = 0; v < picture.rows; ++v) {
      for (int u = 0; u < picture.cols; ++u) {
        if (sun.at<float>(v, u) > 0.15f || sky.at<float>(v, u) < kOpenSky ||
            labels.at<std::uint8_t>(v, u) != 0)
          continue;
        const float lit =
            linearFromRealCode(plate.at<cv::Vec3f>(v, u)[c]) * skyLight(sky.at<float>(v, u));
        if (lit > 0.01f) ratios.push_back(linearFromRealCode(picture.at<cv::Vec3f>(v, u)[c]) / lit);
      }
    }
    if (ratios.size() < 50) continue;
    std::nth_element(ratios.begin(), ratios.begin() + ratios.size() / 2, ratios.end());
    // A shadow that is hardly darker than the light's own ratio says was not seen where it was
    // predicted.
    const float measured = ratios[ratios.size() / 2];
    if (measured < 0.85f) umbra[c] = std::max(measured, 0.1f);
  }
  return umbra;
}

// The same from shadows that pass over the plate: the dark end of what darkens it.
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

cv::Mat linearOf(const cv::Mat& codes) {
  cv::Mat linear(codes.size(), CV_32FC3);
  for (int v = 0; v < codes.rows; ++v) {
    const float* in = codes.ptr<float>(v);
    float* out = linear.ptr<float>(v);
    for (int i = 0; i < 3 * codes.cols; ++i) out[i] = linearFromRealCode(in[i]);
  }
  return linear;
}

std::vector<Actor> keyActors(const Prepared& p) {
  std::vector<Actor> actors;
  for (const Surface& s : p.surfaces) actors.push_back(makeActor(s, s.key_vertices, p.camera));
  return actors;
}

// The key frame, and further frames in which the poses of all moving objects are known, evenly
// spaced.
std::vector<View> viewsOf(const ClipSample& clip, const Prepared& p, const cv::Mat& key_picture) {
  std::vector<View> views = {{key_picture, p.key_labels, p.camera, keyActors(p)}};
  std::vector<const ClipFrame*> usable;
  for (std::size_t i = 1; i < clip.frames().size(); ++i) {
    const ClipFrame& f = clip.frames()[i];
    const auto known = [&](const Surface& s) {
      return std::any_of(f.poses.begin(), f.poses.end(),
                         [&](const ObjectPose& o) { return o.index == s.index; });
    };
    bool all = !f.poses.empty();
    for (std::size_t k = 0; k < p.surfaces.size(); ++k)
      all = all && (!p.moves[k] || known(p.surfaces[k]));
    if (all) usable.push_back(&f);
  }
  const std::size_t count = std::min(usable.size(), kFurtherViews);
  for (std::size_t i = 0; i < count; ++i) {
    const ClipFrame& f = *usable[(i + 1) * usable.size() / count - 1];
    View view{{}, f.labels, f.camera, {}};
    f.bgr.convertTo(view.picture, CV_32F);
    for (std::size_t k = 0; k < p.surfaces.size(); ++k) {
      const Surface& s = p.surfaces[k];
      Points vertices = s.key_vertices;
      for (const ObjectPose& o : f.poses) {
        if (p.moves[k] && o.index == s.index)
          vertices = transformed(s.object_vertices, o.world_from_object);
      }
      view.actors.push_back(makeActor(s, std::move(vertices), f.camera));
    }
    views.push_back(std::move(view));
  }
  return views;
}

// Where an object's surface should be seen at the key frame but no mask is, something stands before
// it. The rim is left out: there the fit is not exact.
cv::Mat frontOf(const cv::Mat& outline, const cv::Mat& labels) {
  const cv::Mat gaps = outline & (labels == 0);
  cv::Mat front, narrow, inside, parts;
  cv::morphologyEx(gaps, front, cv::MORPH_OPEN, cv::Mat::ones(kFrontOpening, kFrontOpening, CV_8U));
  cv::morphologyEx(gaps, narrow, cv::MORPH_OPEN, cv::Mat::ones(kNarrowFront, kNarrowFront, CV_8U));
  cv::distanceTransform(outline, inside, cv::DIST_L2, cv::DIST_MASK_3);
  std::vector<bool> deep(cv::connectedComponents(narrow, parts, 8, CV_32S), false);
  for (int v = 0; v < parts.rows; ++v) {
    for (int u = 0; u < parts.cols; ++u) {
      if (inside.at<float>(v, u) >= kDeepFront) deep[parts.at<int>(v, u)] = true;
    }
  }
  for (int v = 0; v < parts.rows; ++v) {
    for (int u = 0; u < parts.cols; ++u) {
      if (parts.at<int>(v, u) > 0 && deep[parts.at<int>(v, u)]) front.at<std::uint8_t>(v, u) = 255;
    }
  }
  return cv::countNonZero(front) > 0 ? front : cv::Mat();
}

// What the depth image shows just beside an object, off the planes and nearer: it stands before it.
// @param ground nearness of the support planes
cv::Mat nearerBeside(const cv::Mat& mask, const cv::Mat& labels, const cv::Mat& depth,
                     const cv::Mat& ground, int margin) {
  cv::Mat nearness = cv::Mat::zeros(depth.size(), CV_32F), own = nearness.clone();
  cv::Mat(1.0 / depth).copyTo(nearness, depth > 0.0f);
  nearness.copyTo(own, mask);
  cv::dilate(own, own,
             cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * margin + 1, 2 * margin + 1}));
  cv::Mat nearer = (labels == 0) & (own > 0.0f) & (nearness > kNearerBeside * own);
  if (!ground.empty()) nearer &= cv::abs(nearness - ground) > (kNearerBeside - 1.0f) * nearness;
  return nearer;
}

std::vector<cv::Mat> frontsOf(const std::vector<Actor>& actors, const Prepared& p,
                              const RenderParams& params) {
  std::vector<cv::Mat> fronts;
  const cv::Mat ground =
      params.depth.empty() ? cv::Mat() : groundNearness(params.planes, p.camera, cv::Mat());
  for (std::size_t i = 0; i < actors.size(); ++i) {
    cv::Mat front = frontOf(outlineOf(actors[i], p.key_labels.size()), p.key_labels);
    if (!params.depth.empty() && !p.moves[i]) {
      const cv::Mat beside =
          nearerBeside(p.key_labels == p.surfaces[i].index, p.key_labels, params.depth, ground,
                       params.background.mask_margin_px + 1);
      if (cv::countNonZero(beside) > 0) front = front.empty() ? beside : cv::Mat(front | beside);
    }
    fronts.push_back(front);
  }
  return fronts;
}

// What the depth image shows beside the objects, as near as all of its surroundings: its edges are
// not exact.
cv::Mat sceneryOf(const cv::Mat& depth, const Prepared& p, int margin) {
  if (depth.empty()) return {};
  cv::Mat objects = p.key_labels != 0, nearness = cv::Mat::zeros(depth.size(), CV_32F);
  for (const cv::Mat& f : p.footprints) {
    if (!f.empty()) objects |= f;
  }
  cv::dilate(objects, objects,
             cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * margin + 1, 2 * margin + 1}));
  cv::Mat(1.0 / depth).copyTo(nearness, (depth > 0.0f) & (objects == 0));
  cv::erode(nearness, nearness, cv::Mat::ones(3, 3, CV_8U));
  return nearness;
}

cv::Mat grown(const cv::Mat& mask, int radius) {
  cv::Mat out;
  cv::dilate(mask, out,
             cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1}));
  return out;
}

// All that a resting object covers at the key frame: its mask, which can miss thin or dark ends,
// and its model.
std::vector<cv::Mat> footprintsOf(const std::vector<Actor>& actors, const Prepared& p) {
  std::vector<cv::Mat> footprints;
  for (std::size_t i = 0; i < actors.size(); ++i) {
    cv::Mat footprint =
        (p.key_labels == p.surfaces[i].index) | outlineOf(actors[i], p.key_labels.size());
    if (!p.fronts[i].empty()) footprint.setTo(0, p.fronts[i]);
    footprints.push_back(p.moves[i] ? cv::Mat() : footprint);
  }
  return footprints;
}

// What objects at rest cover or shade at the key frame, with soft edges and the predictions'
// errors.
// @param curved CV_8UC1, != 0: keeps its shadows; may be empty
cv::Mat restingTraces(const Prepared& p, const SeenShadows& shadows, const cv::Mat& curved,
                      const RenderParams& params) {
  cv::Mat traces = grown(shadows.sun | shadows.sky, params.background.shadow_margin_px);
  if (!curved.empty()) traces.setTo(0, curved);
  for (std::size_t i = 0; i < p.footprints.size(); ++i) {
    if (p.footprints[i].empty()) continue;
    traces |= grown(p.footprints[i], params.background.mask_margin_px);
    if (!p.fronts[i].empty()) traces.setTo(0, p.fronts[i]);
  }
  return traces;
}

std::vector<Occluder> occluders(const std::vector<Actor>& actors) {
  std::vector<Occluder> all;
  for (const Actor& a : actors)
    all.push_back({&a.vertices, &a.surface->triangles, a.surface->winding});
  return all;
}

// What the support planes mirror, if the key frame shows it. Objects that move in the video have
// left their place in later frames.
// @param unclear CV_8UC1, != 0: objects, shadows
PlaneMirror findMirror(const std::vector<Actor>& actors, const cv::Mat& picture,
                       const cv::Mat& unclear, const cv::Mat& off_planes,
                       const RenderParams& params, const Prepared& p) {
  std::vector<const Actor*> resting;
  std::vector<std::size_t> surfaces;
  for (std::size_t i = 0; i < actors.size(); ++i) {
    if (!p.moves[i]) resting.push_back(&actors[i]), surfaces.push_back(i);
  }
  const Radiance radiance = [&](int slot, const SurfacePoint& point) {
    return mirroredRadiance(p.appearances[surfaces[slot]], p.light.light, Look(), point);
  };
  const MirrorImage image = mirrorImage(resting, radiance, params.planes, p.camera, off_planes);
  if (image.empty()) return {};
  PlaneMirror mirror = establishMirror(image, linearOf(picture),
                                       grown(unclear, params.background.mask_margin_px) == 0);
  if (!mirror.established()) return mirror;
  mirror.off = off_planes;
  mirror.at_key = addedBy(mirror, image);
  return mirror;
}

void prepareBackground(const std::vector<ClipFrame>& frames, const std::vector<View>& views,
                       const std::vector<Actor>& actors, const Background& seen,
                       const cv::Mat& picture, const ShadowMap& sun, const ShadowMap& sky,
                       const RenderParams& params, Prepared& p) {
  const bool any_moves = std::find(p.moves.begin(), p.moves.end(), true) != p.moves.end();
  const bool all_move = std::find(p.moves.begin(), p.moves.end(), false) == p.moves.end();
  p.background = seen;
  const PlaceSurfaces surfaces =
      findSurfaces(p.scenery, params.depth, p.key_labels, params.planes, p.camera);
  p.relief = findRelief(surfaces, p.light.light.direction);
  cv::Mat off_planes = offPlanes(p.scenery, params.planes, p.camera), blind = off_planes.clone();
  if (!p.relief.empty()) blind = off_planes & ~p.relief.seen, off_planes |= p.relief.seen;
  p.shadowless = blind.clone();
  // What is not plane has no like to be filled from: a shadow stays there.
  const cv::Mat curved =
      surfaces.empty() ? cv::Mat() : cv::Mat(surfaces.label == PlaceSurfaces::kCurved);
  if (!curved.empty()) blind |= curved;
  const cv::Mat visibility = placeVisibility(sun, params.planes, p.relief, blind, frames.front());
  const cv::Mat sky_visibility =
      placeVisibility(sky, params.planes, p.relief, off_planes, frames.front());
  cv::Mat shaded;
  if (!all_move) {
    const SeenShadows seen_shadows =
        seenShadows(visibility, sky_visibility, picture, (p.key_labels != 0) | blind);
    if (cv::countNonZero(seen_shadows.refuted) > 0) {
      p.remarks.push_back(
          "a shadow that the light predicts is not seen in the picture: none is taken out or drawn "
          "there; give the light if it is wrong, a depth image if a wall or a step is in its way");
    }
    shaded = restingTraces(p, seen_shadows, curved, params);
    p.shadowless |= grown(seen_shadows.refuted, params.background.shadow_margin_px);
    if (seen_shadows.none) p.shadowless.setTo(255);
    const cv::Mat dark = ((visibility < kUnshadedSun) | (sky_visibility < kUnshadedSky)) &
                         (seen_shadows.refuted == 0);
    p.mirror = findMirror(actors, picture, (p.key_labels != 0) | dark, off_planes, params, p);
  }
  ClipFrame key = frames.front();
  if (p.mirror.established()) {
    p.background.plate = unmirrored(p.mirror, p.background.plate);
    key.bgr = unmirroredCodes(p.mirror, key.bgr);
  }
  inventBackground(shaded, key, groundNearness(params.planes, frames.front().camera, p.scenery),
                   surfaces.label, p.background);
  p.plate_linear = linearOf(p.background.plate);
  const cv::Mat off_the_planes = (p.key_labels != 0) | off_planes;
  const std::optional<cv::Vec3f> umbra =
      any_moves ? umbraInViews(views, params.planes, p.background, p.light.light) : std::nullopt;
  p.umbra = umbra ? *umbra
            : any_moves
                ? umbraOfPassing(frames, params.planes, p.background,
                                 predictedUmbra(p.light.light, params.planes))
                : measureUmbra(picture, p.background.plate, visibility, sky_visibility,
                               off_the_planes, predictedUmbra(p.light.light, params.planes));
  findUmbra(p.light.light, picture, p.background.plate, visibility, p.key_labels, params.planes,
            p.umbra, p.relief);
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

}  // namespace

bool anyMoves(const ClipSample& clip, const std::vector<ObjectModel>& models) {
  return std::any_of(models.begin(), models.end(), [&](const ObjectModel& m) {
    return movesInVideo(clip.frames(), makeSurface(m));
  });
}

Prepared prepare(const ClipSample& clip, const std::vector<ObjectModel>& models,
                 const RenderParams& params) {
  if (clip.frames().empty())
    throw std::invalid_argument(
        "no clip frame with a segmentation has arrived; send the key frame first");
  if (!params.depth.empty() && params.depth.size() != clip.frames().front().bgr.size()) {
    throw std::invalid_argument(
        "the depth image is not of the key frame's size; scale it or leave it out");
  }
  Prepared p;
  p.nearness = placeNearness(
      cameraMoves(clip) ? clip.frames() : std::vector<ClipFrame>{clip.frames().front()},
      params.planes, params.depth, params.background.mask_margin_px);
  const std::vector<ClipFrame> frames = inKeyView(clip, p.nearness);
  p.camera = frames.front().camera;
  p.key_picture = frames.front().bgr;
  p.key_labels = frames.front().labels;
  for (const ObjectModel& m : models) {
    p.surfaces.push_back(makeSurface(m));
    p.moves.push_back(movesInVideo(clip.frames(), p.surfaces.back()));
    p.sways.push_back(!p.moves.back() && !cameraMoves(clip) && swaysInVideo(frames, m.index));
  }
  cv::Mat steadiness;
  const cv::Mat picture = steadyKeyFrame(frames, steadiness);
  const std::vector<Actor> actors = keyActors(p);
  const bool any_moves = std::find(p.moves.begin(), p.moves.end(), true) != p.moves.end();
  const std::vector<View> views = viewsOf(clip, p, picture);
  p.views = static_cast<int>(views.size());
  Stopwatch watch;
  const Background seen = seenBackground(frames, any_moves, params.background);
  p.background_ms = watch.lap();
  const LightEvidence evidence =
      lightEvidence(views, p.moves, params.planes, any_moves ? seen : Background());
  const Eigen::Vector3f view = -p.camera.world_from_camera.linear().col(2).cast<float>();
  p.light = fitLight(evidence, params.up.cast<float>(), view);
  p.light.light.angular_radius = static_cast<float>(params.sun_radius);
  const ShadowMap sun(occluders(actors), p.light.light.direction.cast<double>(),
                      {768, params.sun_radius, 16});
  const std::vector<Occluder> above =
      params.planes.empty() ? std::vector<Occluder>{} : occluders(actors);
  const Eigen::Vector3d up = params.planes.empty() ? params.up : params.planes.front().normal;
  const ShadowMap sky(above, up, {256, kSkyRadius, 24});
  p.appearances = makeAppearances(views, p.moves, p.light.light, p.light.gloss);
  p.appearance_ms = watch.lap();
  p.fronts = frontsOf(actors, p, params);
  p.footprints = footprintsOf(actors, p);
  p.scenery = sceneryOf(params.depth, p, params.background.mask_margin_px);
  prepareBackground(frames, views, actors, seen, picture, sun, sky, params, p);
  p.background_ms += watch.lap();
  std::vector<cv::Mat> pictures;
  for (const ClipFrame& f : frames) pictures.push_back(f.bgr);
  p.noise = NoiseModel::estimate(pictures, steadiness > 1);
  addRemarks(clip.frames(), actors, p);
  return p;
}

}  // namespace calipso::render

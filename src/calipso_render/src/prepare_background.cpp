#include "prepare_background.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "light/shadow_check.hpp"
#include "place/contact_traces.hpp"
#include "place/haze.hpp"
#include "place/hollow.hpp"
#include "place/key_cover.hpp"
#include "place/lifted_shade.hpp"
#include "place/lit_since.hpp"
#include "place/passing_shade.hpp"
#include "place/place_relief.hpp"
#include "place/plane_mirror.hpp"
#include "place/scenery_shade.hpp"
#include "place/umbra.hpp"
#include "place/unseen_casters.hpp"

namespace calipso::render {
namespace {

// visible part of the sun from which a place says how the planes mirror
constexpr float kUnshadedSun = 0.985f;
// frames that must show a place past an object, from which on their median is believed
constexpr int kFewestPast = 3;
constexpr float kQuiet = 5.0f;  // code values of spread over time: the place rests

// What of the place takes shade. @param blind CV_8UC1, != 0: nothing there does
ReceiverOf receiversOf(const std::vector<SupportPlane>& planes, const Relief& relief,
                       const cv::Mat& blind, const Camera& camera) {
  return [&](int u, int v) {
    if (blind.at<std::uint8_t>(v, u) != 0) return std::optional<Receiver>();
    return relief.at(u, v) ? relief.receiver(u, v) : receiverAt(planes, camera, u, v);
  };
}

// Visibility of a light, 0..1, where something takes shade; 1 elsewhere.
cv::Mat placeVisibility(const Visibility& light, const ReceiverOf& receiver_of,
                        const cv::Size& size) {
  cv::Mat visibility(size, CV_32F, cv::Scalar(1.0f));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < visibility.rows; ++v) {
    for (int u = 0; u < visibility.cols; ++u) {
      const std::optional<Receiver> receiver = receiver_of(u, v);
      if (receiver)
        visibility.at<float>(v, u) = light.visibility(receiver->position, receiver->normal);
    }
  }
  return visibility;
}

// What other frames show past the objects that hide it at the key frame.
cv::Mat seenPast(const PlaceEvidence& e) {
  if (!e.camera_moves) return cv::Mat::zeros(e.seen.count.size(), CV_8U);
  return e.seen.count >= kFewestPast;
}

// Where the key frame shows support planes, the relief, and neither.
struct SeenPlace {
  cv::Mat off_planes;  // CV_8UC1: 255 where something else than a support plane is seen
  // ... what is neither plane nor relief, or, unless the light is confirmed, curved (trees, banks):
  // gives up no shadow
  cv::Mat blind;
  cv::Mat curved;   // ... curved and not blind
  cv::Mat surface;  // CV_8UC1: PlaceSurfaces::label; may be empty
  int planes = 0;   // of the surfaces, from 1 on
};

// Shadows on planes and on what is curved, each told by its own kind of surface: what one shows
// (a bank) says nothing of another (water).
// @param unknown as of seenShadows(), but for what is blind
// @param on_planes darkness of shadows there
SeenShadows shadowsOn(const SeenPlace& place, const cv::Mat& sun, const cv::Mat& sky,
                      const cv::Mat& picture, const cv::Mat& unknown, bool sun_is_sure,
                      const UsualDarkness& on_planes = kOnGround) {
  const auto beside = [&](const cv::Mat& left_out, const UsualDarkness& usual) {
    cv::Mat sun_there = sun.clone(), sky_there = sky.clone();
    sun_there.setTo(1.0f, left_out), sky_there.setTo(1.0f, left_out);
    return seenShadows(sun_there, sky_there, picture, unknown | place.blind | left_out, usual,
                       sun_is_sure);
  };
  SeenShadows seen = beside(place.curved, on_planes);
  if (cv::countNonZero(place.curved) == 0) return seen;
  const SeenShadows on_curved = beside(~place.curved, kOnGround);
  seen.sun |= on_curved.sun, seen.sky |= on_curved.sky, seen.refuted |= on_curved.refuted;
  seen.none = cv::countNonZero(seen.refuted) > 0 && cv::countNonZero(seen.sun | seen.sky) == 0;
  seen.no_sun = (seen.no_sun || on_curved.no_sun) && cv::countNonZero(seen.sun) == 0;
  return seen;
}

// Where shadows leave a trace, with the predictions' errors: on the surfaces that they fall on, not
// on what stands before these.
cv::Mat shadeTraces(const SeenShadows& shadows, const SeenPlace& place,
                    const RenderParams& params) {
  const cv::Mat shaded = shadows.sun | shadows.sky;
  cv::Mat traces = grown(shaded, params.background.shadow_margin_px);
  for (int k = 1; k <= place.planes; ++k) {
    const cv::Mat here = place.surface == k;
    traces.setTo(0, here & (grown(shaded & here, params.background.shadow_margin_px) == 0));
  }
  traces.setTo(0, grown(place.blind, 1));
  return traces;
}

// What objects at rest cover or shade at the key frame, with soft edges and the predictions'
// errors.
// @param seen_past CV_8UC1, != 0: not hidden in other frames
cv::Mat restingTraces(const Prepared& p, const SeenShadows& shadows, const SeenPlace& place,
                      const cv::Mat& seen_past, const RenderParams& params) {
  cv::Mat traces = shadeTraces(shadows, place, params);
  for (std::size_t i = 0; i < p.footprints.size(); ++i) {
    if (p.footprints[i].empty()) continue;
    cv::Mat covered = grown(p.footprints[i], params.background.mask_margin_px) & (seen_past == 0);
    traces |= p.fronts[i].empty() ? covered : cv::Mat(covered & ~p.fronts[i]);
  }
  return traces;
}

// What the support planes mirror, if the key frame shows it. Objects that move in the video have
// left their place in later frames.
// @param unclear CV_8UC1, != 0: objects, shadows; sky CV_32FC1, visible part of it
PlaneMirror findMirror(const std::vector<Actor>& actors, const cv::Mat& picture,
                       const cv::Mat& unclear, const cv::Mat& sky, const cv::Mat& off_planes,
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
  PlaneMirror mirror =
      establishMirror(image, linearFromRealCodes(picture),
                      grown(unclear, params.background.mask_margin_px) == 0, 1.0 - sky);
  if (!mirror.established()) return mirror;
  mirror.off = off_planes;
  mirror.at_key = addedBy(mirror, image);
  mirror.key_box = reachedBy(image, mirror.slope);
  return mirror;
}

SeenPlace findPlace(const PlaceSurfaces& surfaces, const RenderParams& params, Prepared& p) {
  SeenPlace place{offPlanes(p.scenery, params.planes, p.camera),
                  {},
                  cv::Mat::zeros(p.key_labels.size(), CV_8U),
                  surfaces.label,
                  static_cast<int>(surfaces.planes.size())};
  place.blind = place.off_planes.clone();
  p.relief = findRelief(surfaces, p.light.light.direction);
  if (!p.relief.empty())
    place.blind = place.off_planes & ~p.relief.seen, place.off_planes |= p.relief.seen;
  p.shadowless = place.blind.clone();
  if (!params.depth.empty()) {
    cv::Mat rims = rimsOff(place.off_planes, p, params);
    addRims(p.scenery, params.depth, p.relief);
    if (!p.relief.empty()) rims.setTo(0, p.relief.seen);
    p.shadowless |= rims | bladesBefore(p, params);
  }
  p.sunless = turnedAway(p.relief, p.light.light.direction);
  if (!p.sunless.empty()) place.blind |= p.sunless;
  if (!surfaces.empty()) {
    cv::Mat& where = p.light.confirmed() ? place.curved : place.blind;
    where |= (surfaces.label == PlaceSurfaces::kCurved) & ~place.blind;
  }
  return place;
}

// @param hidden CV_8UC1: part of the sun, 255 all; may be empty
void addSunless(const cv::Mat& hidden, Prepared& p) {
  if (!hidden.empty()) p.sunless = p.sunless.empty() ? hidden : cv::Mat(cv::max(p.sunless, hidden));
}

// @param receiver what of the place has the sun
void takeUnseenCasters(const CastersShade& shade, const ReceiverOf& receiver, Prepared& p) {
  if (shade.hidden.empty()) return;
  cv::Mat known = shade.known & (p.shadowless == 0);
  if (!p.sunless.empty()) known &= p.sunless == 0;  // what is seen hides it there
  p.unseen_shade = UnseenShade(shade.hidden, known, receiver, p.light.light.direction);
  addSunless(hiddenOnRelief(shade, p.unseen_shade, p.relief), p);
}

// What the objects at rest leave on the place, to be taken out; what of it is mirrored goes to `p`.
cv::Mat findTraces(const PlaceEvidence& e, const SeenPlace& place, const cv::Mat& sun,
                   const cv::Mat& sky, const RenderParams& params, Prepared& p) {
  const cv::Mat objects = p.key_labels != 0;
  SeenShadows shadows = shadowsOn(place, sun, sky, e.picture, objects, p.light.confirmed());
  const cv::Mat dark = (sun < kUnshadedSun) & (shadows.refuted == 0);
  p.mirror = findMirror(e.actors, e.picture, objects | dark, sky, place.off_planes, params, p);
  if (p.mirror.established())  // what is mirrored can be dark, too
    shadows = shadowsOn(place, sun, sky, unmirrored(p.mirror, e.picture), objects,
                        p.light.confirmed(), isWater(p.mirror) ? kOnWater : kOnGround);
  if (cv::countNonZero(shadows.refuted) > 0) {
    p.remarks.push_back(
        "a shadow that the light predicts is not seen in the picture: none is taken out or drawn "
        "there; give the light if it is wrong, a depth image if a wall or a step is in its way");
  }
  cv::Mat without = grown(shadows.refuted, params.background.shadow_margin_px);
  without.setTo(0, shadeTraces(shadows, place, params));  // the other light is hidden there
  p.shadowless |= without;
  if (shadows.none) p.shadowless.setTo(255);
  if (shadows.no_sun && !p.light.confirmed())
    p.sunless = cv::Mat(p.shadowless.size(), CV_8U, cv::Scalar(255));
  return restingTraces(p, shadows, place, seenPast(e), params);
}

// litSince() of the light found.
cv::Mat litPlate(const PlaceEvidence& e, const cv::Mat& sun, const cv::Mat& sky,
                 const RenderParams& params, const Prepared& p) {
  const double umbra = luminance(predictedUmbra(p.light.light, params.planes));
  return litSince(e.picture, p.background.plate, umbra * sky + (1.0 - umbra) * sun, umbra,
                  params.background.shadow_margin_px);
}

// What objects shade at the key frame whose poses in others nobody knows, as they deform, and where
// the plate is as dark.
cv::Mat unfollowedTraces(const PlaceEvidence& e, const SeenPlace& place, const cv::Mat& sun,
                         const cv::Mat& sky, const RenderParams& params, const Prepared& p) {
  const SeenShadows shadows =
      shadowsOn(place, sun, sky, e.picture, p.key_labels != 0, p.light.confirmed());
  return shadeTraces(shadows, place, params) & ~litPlate(e, sun, sky, params, p);
}

// What objects that move shade in all frames that show it. Where others show it, their shade is
// taken off the plate.
cv::Mat passingTraces(const PlaceEvidence& e, const SeenPlace& place, const ReceiverOf& receiver,
                      const cv::Mat& sun, const cv::Mat& sky, const RenderParams& params,
                      Prepared& p) {
  const PassingCast cast{p.surfaces, p.moves, p.light.light.direction.cast<double>(),
                         p.light.light.angular_radius,
                         params.planes.empty() ? params.up : params.planes.front().normal};
  const ShadeThatStays stays =
      leaveOutPassingShade(e.frames, cast, receiver, params.background, p.background);
  if (stays.never_lit.empty()) return unfollowedTraces(e, place, sun, sky, params, p);
  if (p.light.confirmed())
    takeUnseenCasters(unseenCastersShade(stays.told, p.background.plate, place.surface), receiver,
                      p);
  const SeenShadows shadows = shadowsOn(place, stays.sun, stays.sky, p.background.plate,
                                        p.background.count == 0, p.light.confirmed());
  return shadeTraces(shadows, place, params) & stays.never_lit;
}

// The shade of objects at rest is taken off what the key frame shows, where that can be done: if the
// light is confirmed, or hardly anything else is left.
void liftTraces(const PlaceEvidence& e, const SeenPlace& place, const cv::Mat& sun,
                const cv::Mat& sky, const RenderParams& params, cv::Mat& traces, Prepared& p) {
  cv::Mat covered = p.key_labels != 0;
  for (const cv::Mat& f : p.footprints) {
    if (!f.empty()) covered |= f;
  }
  cv::Mat unclear = grown(covered, params.background.mask_margin_px) | (e.seen.spread >= kQuiet) |
                    place.off_planes;
  if (!p.light.confirmed()) unclear |= ~mostlyShaded(place.surface, place.planes, traces, covered);
  const cv::Mat lifted =
      liftShade({e.picture, sun, sky, p.sunless, unclear, params.background.shadow_margin_px},
                traces, predictedUmbra(p.light.light, params.planes), p.background.plate);
  traces.setTo(0, lifted);
}

// What planes mirror is taken off plate and key frame; where nothing else is left it is a trace.
// @param planes CV_8UC1, != 0: seen but for objects
void takeOffMirrored(const cv::Mat& planes, cv::Mat& traces, ClipFrame& key, Prepared& p) {
  p.background.plate = unmirrored(p.mirror, p.background.plate);
  key.bgr = unmirroredCodes(p.mirror, key.bgr);
  p.mirror.lost = lostInMirror(p.mirror, key.bgr, planes & (p.key_labels == 0) & (traces == 0));
  traces |= p.mirror.lost;
}

// @param haze none where objects move: what is measured there has it in
void findUmbra(const PlaceEvidence& e, const Haze& haze, const ReceiverOf& receiver,
               const cv::Mat& sun, const cv::Mat& sky, const RenderParams& params, Prepared& p) {
  const Light& light = p.light.light;
  const bool moves = std::find(p.moves.begin(), p.moves.end(), true) != p.moves.end();
  const UmbraSurfaces surfaces(params.planes, p.relief, p.camera);
  const std::vector<ShadedSpot> spots =
      moves ? surfaces.shadedInViews(e.views, receiver, p.background, light, p.unseen_shade)
            : shadedInPicture(withoutHaze(haze, e.picture, p.nearness),
                              withoutHaze(haze, p.background.plate, p.nearness), sun, sky,
                              p.key_labels != 0);
  const SeenUmbra shared = umbraAt(surfaces.onSupports(spots));
  cv::Vec3f predicted = predictedUmbra(light, params.planes);
  if (moves && !shared.umbra)
    predicted = umbraOfPassing(e.frames, params.planes, p.background, predicted);
  if (moves && shared.refuted && !p.light.confirmed())  // what moves casts none under this sun
    p.sunless = cv::Mat(p.shadowless.size(), CV_8U, cv::Scalar(255));
  p.umbra = surfaces.umbra(spots, moves, shared.umbra.value_or(predicted), light, p.plate_linear);
}

// What drifts before the camera takes no shadows; the plate has it where the key frame does.
// @param ground as of DriftingBackground
void findDrifting(const std::vector<ClipFrame>& frames, const cv::Mat& ground,
                  const BackgroundParams& params, Prepared& p) {
  Background& background = p.background;
  background.drifting = DriftingBackground(frames, params.mask_margin_px, ground);
  if (!background.drifting.established()) return;
  const cv::Mat& where = background.drifting.where();
  p.shadowless |= where;
  background.drifting.draw({0.0f, 0.0f}, p.plate_linear, background.invented);
  for (int v = 0; v < where.rows; ++v) {
    for (int u = 0; u < where.cols; ++u) {
      if (where.at<std::uint8_t>(v, u) == 0) continue;
      for (int c = 0; c < 3; ++c)
        background.plate.at<cv::Vec3f>(v, u)[c] =
            codeFromLinear(p.plate_linear.at<cv::Vec3f>(v, u)[c]);
    }
  }
}

// What guides filling. @param ground as of groundNearness()
InpaintParams knownOfPlace(const PlaceSurfaces& surfaces, const cv::Mat& ground,
                           const RenderParams& params, const Prepared& p) {
  InpaintParams known;
  known.nearness = ground;
  known.surface = surfaces.alike, known.supports = surfaces.supports;
  known.sky = surfaces.sky;
  known.sure = mirrorsSharply(p.mirror) ? surfaces.sureOffSupports() : surfaces.sure;
  const std::vector<PicturePlane> planes =
      surfaces.empty() ? inPicture(params.planes, p.camera) : surfaces.planes;
  for (const PicturePlane& plane : planes) known.planes.push_back(plane.fromPixels(p.camera));
  if (surfaces.empty()) known.supports = static_cast<int>(planes.size());
  return known;
}

// Invents what is hidden: insides of bowls by what goes round in them, the rest by what is around.
void inventPlace(const cv::Mat& traces, const ClipFrame& key, const InpaintParams& known,
                 const PlaceSurfaces& surfaces, const RenderParams& params, Prepared& p) {
  cv::Mat hollows = cv::Mat::zeros(traces.size(), CV_8U);
  if (!surfaces.empty() && !params.planes.empty())
    hollows = fillHollows(p.scenery, surfaces, params.planes.front(), p.camera,
                          p.background.invented | traces, p.background.plate);
  p.background.invented.setTo(0, hollows);
  inventBackground(traces & ~hollows, key, known, params.background, p.background);
  p.background.invented |= hollows;
}

}  // namespace

void prepareBackground(const PlaceEvidence& e, const RenderParams& params, Prepared& p) {
  ClipFrame key = e.frames.front();
  p.background = e.seen;
  const PlaceSurfaces surfaces =
      findSurfaces(p.scenery, params.depth, p.key_labels, params.planes, p.camera);
  const SeenPlace place = findPlace(surfaces, params, p);
  p.shadowless |= frontsInSun(e.sun, params, p);
  const ReceiverOf in_sun = receiversOf(params.planes, p.relief, place.blind, p.camera),
                   under_sky = receiversOf(params.planes, p.relief, place.off_planes, p.camera);
  cv::Mat sun = placeVisibility(e.sun, in_sun, key.bgr.size());
  const cv::Mat sky = placeVisibility(e.sky, under_sky, key.bgr.size());
  const auto any = [&](bool moves) {
    return std::find(p.moves.begin(), p.moves.end(), moves) != p.moves.end();
  };
  const bool any_rests = any(false), any_moves = any(true);
  if (p.light.confirmed()) {
    const cv::Mat shaded =
        shadeOfScenery(p.scenery, surfaces, p.camera, p.light.light.direction, in_sun);
    addSunless(shaded, p);
  }
  if (!p.sunless.empty()) sun.setTo(1.0f, p.sunless);
  cv::Mat traces =
      any_rests ? findTraces(e, place, sun, sky, params, p) : cv::Mat::zeros(key.bgr.size(), CV_8U);
  if (any_rests && any_moves) {  // what has left some place shades it no more
    const cv::Mat shaded = isShaded(placeVisibility(e.sun_past_resting, in_sun, key.bgr.size()),
                                    placeVisibility(e.sky_past_resting, under_sky, key.bgr.size()));
    traces.setTo(
        0, litPlate(e, sun, sky, params, p) & ~grown(shaded, params.background.shadow_margin_px));
  }
  if (any_rests && !isWater(p.mirror)) liftTraces(e, place, sun, sky, params, traces, p);
  if (any_rests && !p.relief.empty()) traces |= contactTraces(e.actors, e.picture, params, p);
  if (any_moves) traces |= passingTraces(e, place, in_sun, sun, sky, params, p);
  if (!p.sunless.empty()) sun.setTo(1.0f, p.sunless);  // what passing shade has told since
  const cv::Mat ground = groundNearness(params.planes, key.camera, p.scenery);
  if (p.mirror.established())
    takeOffMirrored((ground > 0.0f) & (place.off_planes == 0), traces, key, p);
  inventPlace(traces, key, knownOfPlace(surfaces, ground, params, p), surfaces, params, p);
  if (!p.background.live.empty())
    p.background.passing = PassingThings(e.frames, params.background.mask_margin_px);
  if (e.camera_moves && !p.scenery.empty())
    followPlanes(surfaces, p.background.invented & (p.scenery == 0.0f), p.nearness);
  p.plate_linear = linearFromRealCodes(p.background.plate);
  findDrifting(e.frames,
               ground.empty() ? ground : cv::Mat((ground > 0.0f) & (place.off_planes == 0)),
               params.background, p);
  const Haze haze = any_moves || surfaces.empty()
                        ? Haze()
                        : Haze(e.picture, p.scenery, surfaces.sky == InpaintParams::kSky);
  p.veil = veilOf(haze, p.plate_linear, p.nearness);
  findUmbra(e, haze, in_sun, sun, sky, params, p);
  if (p.sunless.empty()) return;
  cv::Mat umbra;
  cv::extractChannel(p.umbra, umbra, 3);
  p.sunless = lowestSun(p.sunless, umbra);
}

}  // namespace calipso::render

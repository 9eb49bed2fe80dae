#include "frame/resting_light.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/sky_map.hpp"
#include "draw/wide_loops.hpp"
#include "frame/mask_morphology.hpp"
#include "frame/occlusion.hpp"
#include "frame/plane_light.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {
namespace {

std::uint8_t levelAt(const cv::Mat& picture, int u, int v) {
  return picture.empty() ? 255 : picture.at<std::uint8_t>(v, u);
}

// The whole picture's levels of the sun within `bounds`; beyond it is all lit.
// @param shaded gets the squares that are not known to be all lit; may be null
cv::Mat sunLevels(const StagedFrame& frame, const SeenPlace& place, const Visibility& sun,
                  const cv::Rect& bounds, SquareMask* shaded) {
  cv::Mat levels(frame.input.bgr.size(), CV_8U, cv::Scalar(255)), part = levels(bounds);
  planesInLight(place.view, sun, bounds, SquareMask(), part, shaded);
  return levels;
}

SkyGrid skyGrid(const StagedFrame& frame, const SeenPlace& place, const Visibility& sky) {
  return SkyGrid(place.view.planes(), sky, frame.input.bgr.size(), frame.whole(), SquareMask());
}

cv::Mat skyLevels(const SkyGrid& grid, const SeenPlace& place, const Visibility& sky,
                  const ReliefSky& on_walls, const cv::Size& size) {
  cv::Mat levels(size, CV_8U);
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = 0; v < size.height; ++v) {
    grid.levels(place.view.planes(), sky, v, 0, size.width, levels.ptr<std::uint8_t>(v));
    takeReliefSky(place.view.relief(), on_walls, v, 0, size.width, levels.ptr<std::uint8_t>(v));
  }
  return levels;
}

}  // namespace

const RestingLight& RestingLight::update(const StagedFrame& frame, const SeenPlace& place) {
  std::vector<Occluder> others, unedited;
  std::vector<Points> others_now;
  for (const StagedObject& object : frame.objects) {
    if (frame.casts(object.surface)) continue;
    others.push_back(object.occluder());
    if (!object.edited) unedited.push_back(object.occluder());
    others_now.push_back(object.actor.vertices);
  }
  const bool same = others_ && edited_ == frame.edited && sun_ == frame.light.direction &&
                    sameView(camera_, frame.input.camera);
  const bool others_rest = others_vertices_ == others_now;
  if (!same || !others_rest) measureOthers(frame, place, others, unedited);
  if (!same) measureOriginals(frame, place);
  if (!same || !others_rest) findShaded(frame, place), join(frame, place);
  edited_ = frame.edited, camera_ = frame.input.camera, sun_ = frame.light.direction;
  others_vertices_ = std::move(others_now);
  return *this;
}

void RestingLight::measureOthers(const StagedFrame& frame, const SeenPlace& place,
                                 const std::vector<Occluder>& others,
                                 const std::vector<Occluder>& unedited) {
  others_ = sunVisibility(others, frame.light, frame.params);
  const auto levels = [&](const Visibility& sun, const Light& light) {
    cv::Rect bounds;
    for (const Occluder& o : others)
      bounds |= shadowBounds(frame, place.view.relief(), *o.vertices, light.direction);
    return bounds.empty() ? cv::Mat() : sunLevels(frame, place, sun, bounds, nullptr);
  };
  const Light& of_video = frame.prepared.light.light;
  const bool as_in_video = frame.hasSunOfVideo();
  others_sun_ = levels(*others_, frame.light);
  others_sun_in_video_ =
      as_in_video ? others_sun_ : levels(*sunVisibility(others, of_video, frame.params), of_video);
  sunless_place_ = as_in_video ? place.sunless : cv::Mat();
  others_sky_.release();
  if (unedited.empty()) return;
  const auto sky = skyVisibility(unedited, frame.params);
  others_sky_ =
      skyLevels(skyGrid(frame, place, *sky), place, *sky,
                skyOnWalls(unedited, place.view.relief(), frame.params), frame.input.bgr.size());
}

void RestingLight::measureOriginals(const StagedFrame& frame, const SeenPlace& place) {
  const Prepared& prepared = frame.prepared;
  const Light& light = prepared.light.light;  // the video's
  std::vector<Occluder> originals;
  bounds_ = footprints_ = {};
  for (std::size_t i = 0; i < frame.edited.size(); ++i) {
    if (!frame.edited[i]) continue;
    if (!place.footprints[i].empty()) footprints_ |= cv::boundingRect(place.footprints[i]);
    const Surface& s = prepared.surfaces[i];
    if (prepared.moves[i] || !s.in_video) continue;
    originals.push_back({&s.key_vertices, &s.triangles, s.winding});
    bounds_ |= shadowBounds(frame, place.view.relief(), s.key_vertices, light.direction);
  }
  originals_ = originals.empty() ? nullptr : sunVisibility(originals, light, frame.params);
  sunless_ = SquareMask(frame.whole());
  originals_sun_ =
      bounds_.empty() ? cv::Mat() : sunLevels(frame, place, *originals_, bounds_, &sunless_);
  const auto sky = skyVisibility(originals, frame.params);
  originals_sky_ = skyGrid(frame, place, *sky);
  const ReliefSky on_walls = skyOnWalls(originals, place.view.relief(), frame.params);
  shades_walls_ = !on_walls.empty();
  originals_sky_levels_ = skyLevels(originals_sky_, place, *sky, on_walls, frame.input.bgr.size());
}

// Where the originals darken what the others leave of the light.
void RestingLight::findShaded(const StagedFrame& frame, const SeenPlace& place) {
  const cv::Size size = frame.input.bgr.size();
  cv::Mat sky_levels = originals_sky_levels_.clone();
  shaded_ = cv::Mat::zeros(size, CV_8U);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < size.height; ++v) {
    leaveHidden(v, 0, size.width, sky_levels.ptr<std::uint8_t>(v));
    for (int u = 0; u < size.width; ++u) {
      const std::uint8_t none = sunless_place_.empty() ? 0 : sunless_place_.at<std::uint8_t>(v, u),
                         sun = std::max(none, levelAt(originals_sun_, u, v)),
                         sky = sky_levels.at<std::uint8_t>(v, u);
      if ((sun == 255 && sky == 255) || !place.takesShadow(u, v)) continue;
      const float clear =
          place.veil.empty() ? 1.0f : 1.0f - kPerLevel * place.veil.at<std::uint8_t>(v, u);
      shaded_.at<std::uint8_t>(v, u) =
          changeOfLight(clear * (1.0f - shadowRatio(place.umbra.at<cv::Vec4b>(v, u)[3], sun, sky)));
    }
  }
  cv::dilate(shaded_, shaded_, disc(frame.params.background.shadow_margin_px));
  shaded_box_ = cv::boundingRect(shaded_);
}

// Sun and sky before the edit, and where light is taken at all.
void RestingLight::join(const StagedFrame& frame, const SeenPlace& place) {
  const cv::Size size = frame.input.bgr.size();
  sun_before_.create(size, CV_8U), takes_.create(size, CV_8U);
  sky_before_ = originals_sky_levels_.clone();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < size.height; ++v) {
    std::uint8_t *sun = sun_before_.ptr<std::uint8_t>(v), *sky = sky_before_.ptr<std::uint8_t>(v);
    joinSun(place, v);
    leaveHidden(v, 0, size.width, sky);
    veilLevels(place.veil, v, 0, size.width, sun), veilLevels(place.veil, v, 0, size.width, sky);
  }
}

// Row v of what originals and others leave of the sun together, and of what takes shadows.
CALIPSO_WIDE_LOOPS void RestingLight::joinSun(const SeenPlace& place, int v) {
  std::uint8_t *before = sun_before_.ptr<std::uint8_t>(v), *takes = takes_.ptr<std::uint8_t>(v);
  const int width = takes_.cols;
  if (!originals_sun_.empty())
    std::copy_n(originals_sun_.ptr<std::uint8_t>(v), width, before);
  else
    std::fill_n(before, width, 255);
  addOthersSun(v, 0, width, before);
  place.view.seesRow(0, v, width, takes);
  if (place.shadowless.empty()) return;
  const std::uint8_t* none = place.shadowless.ptr<std::uint8_t>(v);
  for (int u = 0; u < width; ++u) takes[u] = none[u] == 0 ? takes[u] : 0;
}

void RestingLight::addOthersSun(int v, int begin, int end, std::uint8_t* sun) const {
  if (!others_sun_.empty()) {
    const std::uint8_t* others = others_sun_.ptr<std::uint8_t>(v) + begin;
    for (int k = 0; k < end - begin; ++k) sun[k] = bothLevels(sun[k], others[k]);
  }
  if (sunless_place_.empty()) return;
  const std::uint8_t* sunless = sunless_place_.ptr<std::uint8_t>(v) + begin;
  for (int k = 0; k < end - begin; ++k) sun[k] = std::max(sun[k], sunless[k]);
}

void RestingLight::leaveHidden(int v, int begin, int end, std::uint8_t* sky) const {
  if (others_sky_.empty()) return;
  const float all_hidden = skyLight(0.0f), scale = kPerLevel / (1.0f - all_hidden),
              offset = all_hidden / (1.0f - all_hidden);
  const std::uint8_t* others = others_sky_.ptr<std::uint8_t>(v) + begin;
  for (int k = 0; k < end - begin; ++k) {
    const float left = std::clamp(scale * others[k] - offset, 0.0f, 1.0f);
    sky[k] = static_cast<std::uint8_t>(255.5f - left * static_cast<float>(255 - sky[k]));
  }
}

}  // namespace calipso::render

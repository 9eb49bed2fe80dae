#include "place/passing_shade.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"
#include "light/shadow_check.hpp"
#include "place/key_cover.hpp"
#include "place/place_samples.hpp"
#include "place/unseen_casters.hpp"

namespace calipso::render {
namespace {

constexpr int kStride = 2;              // px between the places for which shade is predicted
constexpr float kSameSky = 0.02f;       // visible part of the sky that tells two frames apart
constexpr std::size_t kFewestOpen = 3;  // frames under more sky that stand for all
// code values: of faint shade, such as an object beside a place leaves, a pixel's noise hides what is
// shade's
constexpr float kVisible = 1.0f;
constexpr float kHidden = 0.05f;  // visible part of the sun up to which it is hidden

// What a frame is predicted to show, one value per kStride px.
struct Lighting {
  cv::Mat sun, sky;  // CV_32FC1, visible part
};

// The places that take shade, one per kStride px.
struct Places {
  cv::Size size;
  std::vector<std::optional<Receiver>> receivers;
};

Places placesOf(const ReceiverOf& receiver, const cv::Size& picture) {
  Places places{{(picture.width + kStride - 1) / kStride, (picture.height + kStride - 1) / kStride},
                {}};
  for (int j = 0; j < places.size.height; ++j) {
    for (int i = 0; i < places.size.width; ++i)
      places.receivers.push_back(receiver(kStride * i, kStride * j));
  }
  return places;
}

// The objects that move where a frame has them. Empty unless all their poses are known.
std::vector<Points> movingShapes(const ClipFrame& frame, const PassingCast& cast, bool is_key) {
  std::vector<Points> shapes;
  for (std::size_t k = 0; k < cast.surfaces.size(); ++k) {
    const Surface& s = cast.surfaces[k];
    if (!cast.moves[k]) continue;
    const auto pose = std::find_if(frame.poses.begin(), frame.poses.end(),
                                   [&](const ObjectPose& o) { return o.index == s.index; });
    if (pose != frame.poses.end())
      shapes.push_back(transformed(s.object_vertices, pose->world_from_object));
    else if (is_key)
      shapes.push_back(s.key_vertices);
    else
      return {};
  }
  return shapes;
}

Lighting lightingOf(const std::vector<Points>& shapes, const PassingCast& cast,
                    const Places& places) {
  std::vector<Occluder> occluders;
  for (std::size_t k = 0, i = 0; k < cast.surfaces.size(); ++k) {
    if (cast.moves[k])
      occluders.push_back({&shapes[i++], &cast.surfaces[k].triangles, cast.surfaces[k].winding});
  }
  const ShadowMap sun(occluders, cast.to_sun, {512, cast.sun_radius, 16});
  const SkyMap sky(occluders, cast.up, {});
  Lighting out{cv::Mat(places.size, CV_32F, cv::Scalar(1.0f)),
               cv::Mat(places.size, CV_32F, cv::Scalar(1.0f))};
#pragma omp parallel for schedule(dynamic, 8)
  for (int k = 0; k < static_cast<int>(places.receivers.size()); ++k) {
    const std::optional<Receiver>& r = places.receivers[k];
    if (!r) continue;
    out.sun.at<float>(k) = sun.visibility(r->position, r->normal);
    out.sky.at<float>(k) = sky.visibility(r->position, r->normal);
  }
  return out;
}

// A frame's predicted shade, of the picture's size, CV_8UC1.
struct Shade {
  cv::Mat core, near;  // near: within the prediction's error of it
  cv::Mat umbra;       // the sun is hidden, whatever the error
};

Shade shadeOf(const Lighting& lighting, const cv::Size& size, int margin) {
  Shade shade;
  cv::resize(isShaded(lighting.sun, lighting.sky), shade.core, size, 0, 0, cv::INTER_NEAREST);
  shade.near = grown(shade.core, margin);
  cv::Mat sun;
  cv::resize(lighting.sun > kHidden, sun, size, 0, 0, cv::INTER_NEAREST);
  shade.umbra = ~grown(sun, margin);
  return shade;
}

// A pixel's values over time: in shade by the prediction, within its error, and neither.
struct Sorted {
  Samples core, near, lit;
  Samples umbra;        // of the core, those that the sun does not reach
  bool dimmed = false;  // of those in no shade, some were left out: objects hid more of their sky
};

class Sorter {
 public:
  Sorter(const std::vector<ClipFrame>& frames, int margin)
      : frames_(frames), samples_(frames, margin), shades_(frames.size()), skies_(frames.size()) {}

  void set(std::size_t frame, const Shade& shade, const cv::Mat& sky) {
    shades_[frame] = shade, skies_[frame] = sky;
  }

  // Of the frames whose shade is known.
  Sorted at(int u, int v) const {
    Sorted s;
    std::vector<std::size_t> lit;
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      if (!shades_[i] || !samples_.shows(i, u, v)) continue;
      if (shades_[i]->umbra.at<std::uint8_t>(v, u) != 0)
        s.umbra.push_back(frames_[i].bgr.at<cv::Vec3b>(v, u));
      if (shades_[i]->core.at<std::uint8_t>(v, u) != 0)
        s.core.push_back(frames_[i].bgr.at<cv::Vec3b>(v, u));
      else if (shades_[i]->near.at<std::uint8_t>(v, u) != 0)
        s.near.push_back(frames_[i].bgr.at<cv::Vec3b>(v, u));
      else
        lit.push_back(i);
    }
    s.dimmed = keepOpen(u, v, lit);
    for (const std::size_t i : lit) s.lit.push_back(frames_[i].bgr.at<cv::Vec3b>(v, u));
    return s;
  }

  bool shows(std::size_t frame, int u, int v) const { return samples_.shows(frame, u, v); }

 private:
  float skyOf(std::size_t frame, int u, int v) const {
    return skies_[frame].at<float>(v / kStride, u / kStride);
  }

  // Keeps the frames that have the most sky there. @return whether there were others
  bool keepOpen(int u, int v, std::vector<std::size_t>& frames) const {
    float most = 0.0f;
    for (const std::size_t i : frames) most = std::max(most, skyOf(i, u, v));
    const auto dim = [&](std::size_t i) { return skyOf(i, u, v) < most - kSameSky; };
    const std::size_t dims = std::count_if(frames.begin(), frames.end(), dim);
    if (dims == 0 || frames.size() - dims < kFewestOpen) return false;
    frames.erase(std::remove_if(frames.begin(), frames.end(), dim), frames.end());
    return true;
  }

  const std::vector<ClipFrame>& frames_;
  PlaceSamples samples_;
  std::vector<std::optional<Shade>> shades_;
  std::vector<cv::Mat> skies_;  // Lighting::sky
};

// The brightest that is shown of every place.
void brighten(const Lighting& now, const Sorter& sorter, std::size_t frame, Lighting& most) {
  for (int j = 0; j < most.sun.rows; ++j) {
    for (int i = 0; i < most.sun.cols; ++i) {
      if (!sorter.shows(frame, kStride * i, kStride * j)) continue;
      most.sun.at<float>(j, i) = std::max(most.sun.at<float>(j, i), now.sun.at<float>(j, i));
      most.sky.at<float>(j, i) = std::max(most.sky.at<float>(j, i), now.sky.at<float>(j, i));
    }
  }
}

// Within the prediction's error the values tell what is lit: what differs from the shaded ones as
// shade does.
Samples litAmong(const Samples& near, const Samples& core, double step) {
  Samples lit;
  for (const cv::Vec3b& c : near) {
    if (!core.empty() && shadedAgainst({c}, core, step)) lit.push_back(c);
  }
  return lit;
}

// Of values that all lie in shade: those of its rim, or under less of it, if the others differ from
// them as shade does.
Samples leastShaded(const Sorted& s, double step) {
  Samples all = s.core;
  all.insert(all.end(), s.near.begin(), s.near.end());
  Samples bright = all;
  keepBrighter(bright);
  return shadedAgainst(bright, all, step) ? bright : Samples();
}

// Takes the mean of values for the plate if it is brighter by that much, code values.
void takeIfBrighter(const Samples& values, float by, Background& background, int u, int v) {
  float spread = 0.0f;
  const cv::Vec3f mean = robustMean(values, spread);
  cv::Vec3f& plate = background.plate.at<cv::Vec3f>(v, u);
  const cv::Vec3f gain = mean - plate;
  if (gain[0] + 2.0f * gain[1] + gain[2] < 4.0f * by) return;
  plate = mean, background.spread.at<float>(v, u) = spread;
}

// Does the sun reach a place? Half a step darker is neither yes nor no.
std::uint8_t sunAt(const Sorted& s, double step) {
  if (s.umbra.empty() || s.lit.size() < kFewestOpen) return kSunUntold;
  if (shadedAgainst(s.lit, s.umbra, step)) return kSun;
  return shadedAgainst(s.lit, s.umbra, 0.5 * step) ? kSunUntold : kNoSun;
}

// Takes the shaded frames out of a plate's median, and those that objects leave less of the sky.
// @return ShadeThatStays::never_lit and told
ShadeThatStays dropShadedFrames(const Sorter& sorter, double step, Background& background) {
  const cv::Size size = background.plate.size();
  cv::Mat never_lit = cv::Mat::zeros(size, CV_8U), told = never_lit.clone();
  background.shaded_at_times = cv::Mat::zeros(size, CV_8U);
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      Sorted s = sorter.at(u, v);
      if (s.core.empty() && s.near.empty()) {
        if (s.dimmed) takeIfBrighter(s.lit, kVisible, background, u, v);
        continue;
      }
      background.shaded_at_times.at<std::uint8_t>(v, u) = 255;
      told.at<std::uint8_t>(v, u) = sunAt(s, step);
      if (s.lit.empty()) s.lit = litAmong(s.near, s.core, step);
      if (s.lit.empty()) {
        never_lit.at<std::uint8_t>(v, u) = 255;
        const Samples least = leastShaded(s, step);
        if (!least.empty()) takeIfBrighter(least, -kVisible, background, u, v);
        continue;
      }
      if (!shadedAgainst(s.lit, s.core.empty() ? s.near : s.core, step)) {
        if (s.lit.size() >= kFewestOpen) takeIfBrighter(s.lit, kVisible, background, u, v);
        continue;
      }
      dropShaded(step, s.lit);
      // Where it is darker, frames without a known pose show more of the light.
      takeIfBrighter(s.lit, -kVisible, background, u, v);
    }
  }
  return {{}, {}, never_lit, told};
}

}  // namespace

ShadeThatStays leaveOutPassingShade(const std::vector<ClipFrame>& frames, const PassingCast& cast,
                                    const ReceiverOf& receiver, const BackgroundParams& params,
                                    Background& background) {
  const cv::Size size = frames.front().bgr.size();
  const Places places = placesOf(receiver, size);
  Sorter sorter(frames, params.mask_margin_px);
  Lighting most{cv::Mat::zeros(places.size, CV_32F), cv::Mat::zeros(places.size, CV_32F)};
  bool any = false;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const std::vector<Points> shapes = movingShapes(frames[i], cast, i == 0);
    if (shapes.empty()) continue;
    const Lighting now = lightingOf(shapes, cast, places);
    sorter.set(i, shadeOf(now, size, params.shadow_margin_px), now.sky);
    brighten(now, sorter, i, most);
    any = any || i > 0;
  }
  if (!any) return {};
  ShadeThatStays stays = dropShadedFrames(sorter, params.shadow_step, background);
  cv::resize(most.sun, stays.sun, size, 0, 0, cv::INTER_LINEAR);
  cv::resize(most.sky, stays.sky, size, 0, 0, cv::INTER_LINEAR);
  for (cv::Mat* visible : {&stays.sun, &stays.sky}) visible->setTo(1.0f, stays.never_lit == 0);
  return stays;
}

}  // namespace calipso::render

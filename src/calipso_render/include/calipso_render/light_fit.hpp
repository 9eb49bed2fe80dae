#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_render/background.hpp"
#include "calipso_render/light.hpp"
#include "calipso_render/stage.hpp"

namespace calipso::render {

// What one pixel says about the light.
struct LightSample {
  Eigen::Vector3f position, normal, view;  // world; view: unit, towards the camera
  cv::Vec3f radiance;                      // linear
  int cluster = 0;                         // pixels of one cluster share an albedo
  SkySeen seen;                            // of the sky
  int picture = 0;                         // view that it is from
};

// Pixels of the objects away from rims, grazing views and saturation, clustered by chromaticity per
// object. Later views add the objects that `moves` says are somewhere else in them.
// @param clusters out: number of clusters
std::vector<LightSample> lightSamples(const std::vector<View>& views,
                                      const std::vector<bool>& moves, int& clusters);

struct LightFit;

// Gloss as highlights show it. They do not tell roughnesses from `smoothest` to `roughest` apart
// (model errors included: where the light is confirmed, the truth is between them in most scenes).
struct SeenGloss {
  Gloss gloss;
  float smoothest = 0.0f, roughest = 0.0f;
  bool tells_direction = false;  // they are where the light found puts them, and not beside it

  bool leaves(float roughness) const { return roughness >= smoothest && roughness <= roughest; }
};

struct SeenGlosses {
  std::optional<SeenGloss> of_all;  // objects together
  // by object, where its own highlights tell it, and another one than `of_all`
  std::vector<std::optional<SeenGloss>> of_one;
};

// The sun as the borders of its shadows show it.
struct SunByBorders {
  Eigen::Vector3f direction;  // unit, towards it, world
  // rad, of its disc; none: no border is far enough from what casts it
  std::optional<float> radius;
};

// All that the pictures show of the light. The functions are called from several threads at once.
struct LightEvidence {
  std::vector<LightSample> samples;
  int clusters = 0;
  // Linear colour of what lies below the objects, mean 1: grey where no support plane is seen.
  cv::Vec3f below = {1.0f, 1.0f, 1.0f};
  float below_brightness = 0.0f;  // its mean, linear; 0: none is seen
  // Linear, mean of what is seen beside the objects, and so about behind them; 0: nothing is.
  cv::Vec3f behind = {};
  // Visible part (0 or 1) of a sun in direction l from a sample; empty: nothing is in the way.
  std::function<float(const LightSample&, const Eigen::Vector3f& l)> visible;
  // How badly cast shadows agree with a sun in direction l: minus a log-likelihood, 0 = no shadow
  // was seen; may be empty.
  std::function<double(const Eigen::Vector3f& l)> shadow_misfit;
  std::vector<Eigen::Vector3f> shadow_candidates;  // directions that cast shadows speak for
  std::optional<Eigen::Vector3f> known_sun;        // the sun's direction, if it need not be found
  // Where borders of cast shadows put a sun that is nearly in direction l; may be empty, and tell
  // nothing.
  std::function<std::optional<SunByBorders>(const Eigen::Vector3f& l)> borders;
  // Gloss from the pixels near the mirror direction, in the clusters of the evidence's samples nearest
  // to them, under a light found; may be empty, and find none.
  std::function<SeenGlosses(const LightFit&, const LightEvidence&)> gloss;
};

// What views, one or several, show. @param plate what was seen of the place without the objects,
// from the key frame's camera; empty where nothing moves
// @param depth CV_32FC1, m, of the key frame, 0: unknown; may be empty
// @pre the views outlive the evidence
LightEvidence lightEvidence(const std::vector<View>& views, const std::vector<bool>& moves,
                            const std::vector<SupportPlane>& planes, const Background& plate,
                            const cv::Mat& depth);

struct LightFit {
  Light light;
  Gloss
      gloss;  // of all objects together: what highlights tell, or what the shading leaves possible
  SeenGlosses seen_gloss;
  std::vector<cv::Vec3f> albedos;  // per cluster, up to a common factor
  bool determined = false;  // false: too little was seen; the light is a default, high and frontal
  bool second_order = false;  // ambient light in bands 1 and 2, too: held-out pixels spoke for it
  bool from_shadows = false;  // cast shadows decided on the direction
  std::optional<SunByBorders> by_borders;  // only then: what their borders make of it
  double cost = 0.0;                       // of the last pass, half the robust sum of squares

  // Something besides shading speaks for the direction: shading alone is off by tens of degrees
  // where surfaces of one albedo are few.
  bool confirmed() const {
    return determined &&
           (from_shadows || (seen_gloss.of_all && seen_gloss.of_all->tells_direction));
  }
  // What tells an object's gloss, if anything. What looks like a highlight is none where it may be
  // the light that is somewhere else.
  std::optional<SeenGloss> toldGloss(std::size_t object) const;
  Gloss glossOf(std::size_t object) const;
  // @param cloth per object; it is matt unless its own highlights, or such of nothing but cloth,
  // tell otherwise
  std::vector<Gloss> glosses(const std::vector<bool>& cloth) const;
};

// Sun direction, sun and ambient colour, albedos and gloss from shading and cast shadows: a search
// over directions, then four passes (light, diffuse, specular, roughness) and one with everything
// free, from each of the best directions (paper: section 6). The objects shade themselves and each
// other.
// @param up unit vector against gravity: the sun is not below the horizon
// @param view unit vector towards the camera, for the default
LightFit fitLight(const LightEvidence& evidence, const Eigen::Vector3f& up,
                  const Eigen::Vector3f& view);

}  // namespace calipso::render

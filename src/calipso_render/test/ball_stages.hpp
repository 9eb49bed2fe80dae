#pragma once

// The stages of a frame in which a ball over a table is moved, in a light that is known.

#include <memory>
#include <optional>

#include "ball_setting.hpp"
#include "frame/drawn_surfaces.hpp"
#include "frame/edited_region.hpp"
#include "frame/moved_shadow.hpp"
#include "frame/reflections.hpp"
#include "frame/removed.hpp"
#include "frame/resting_light.hpp"
#include "frame/seen_place.hpp"
#include "frame/shaded_others.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render::testing {

// What was learnt of the ball, in exact light, and shadows are believed in.
inline std::shared_ptr<Prepared> litSetting(const Setting& setting) {
  auto prepared = std::make_shared<Prepared>(*setting.prepared);
  prepared->light.light = sunlight();
  prepared->shadowless.release();
  return prepared;
}

struct BallStages {
  RenderParams render;
  Setting setting{render};
  std::shared_ptr<Prepared> prepared = litSetting(setting);
  FrameInput input;
  StagedFrame frame;
  SeenPlace place;
  Reflections reflections;
  MovedShadow moved;
  RestingLight resting;
  ShadedOthers others;
  EditedRegion region;
  ShownPixels shown;
  cv::Mat removed;
  DrawnSurfaces surfaces;

  explicit BallStages(const Eigen::Vector3f& move, const RenderParams& given = params())
      : render(given),
        input(setting.input(true, move)),
        frame(*prepared, render, input),
        place(frame),
        reflections(frame, place),
        moved(frame, place),
        others(frame, moved, resting.update(frame, place)),
        region(frame, resting, moved, others, reflections, cv::Mat()),
        removed(removedPixels(frame, place, region, cv::Mat(), reflections.marks(), shown)),
        surfaces(frame, place, region, removed) {}
};

// How far a table pixel's way to the sun passes from a ball's centre, in radii; no value: it does
// not see the table, or the ball is behind it.
inline std::optional<double> passesBy(float u, float v, const Eigen::Vector3d& centre) {
  const auto at = receiverAt(table(), camera(), u, v);
  if (!at) return std::nullopt;
  const Eigen::Vector3d sun = sunlight().direction.cast<double>(),
                        way = centre - at->position.cast<double>();
  if (way.dot(sun) <= 0.0) return std::nullopt;
  return (way - way.dot(sun) * sun).norm() / kBallRadius;
}

}  // namespace calipso::render::testing

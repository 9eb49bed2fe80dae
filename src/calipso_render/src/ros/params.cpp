#include "params.hpp"

#include <stdexcept>

#include "calipso_ros/node_main.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::render {
namespace {

Mode modeFromString(const std::string& name) {
  if (name == "bag") return Mode::kBag;
  if (name == "live") return Mode::kLive;
  throw std::invalid_argument("parameter mode is '" + name + "'; it must be bag or live");
}

Quality qualityFromString(const std::string& name) {
  if (name == "live") return Quality::kLive;
  if (name == "final") return Quality::kFinal;
  throw std::invalid_argument("parameter quality is '" + name + "'; it must be live or final");
}

template <typename T>
T inRange(const ros::NodeHandle& pnh, const std::string& name, T fallback, T low, T high) {
  const T value = pnh.param(name, fallback);
  if (!(value >= low && value <= high)) {
    throw std::invalid_argument("parameter " + name + " is " + std::to_string(value) + "; it must lie in " +
                                std::to_string(low) + " .. " + std::to_string(high));
  }
  return value;
}

}  // namespace

NodeParams loadParams(const ros::NodeHandle& pnh) {
  NodeParams p;
  p.scene = requiredParam<std::string>(pnh, "scene");
  p.mode = modeFromString(pnh.param<std::string>("mode", "bag"));
  p.render.quality = qualityFromString(pnh.param<std::string>("quality", "live"));
  p.render.sun_radius = inRange(pnh, "sun_radius", p.render.sun_radius, 0.0, 0.5);
  p.render.add_noise = pnh.param("add_noise", p.render.add_noise);
  p.render.background.mask_margin_px = inRange(pnh, "mask_margin_px", p.render.background.mask_margin_px, 0, 50);
  p.clip_samples = inRange(pnh, "clip_samples", p.clip_samples, 2, 200);
  p.live_queue = inRange(pnh, "live_queue", p.live_queue, 1, 1000);
  const Scene scene = loadScene(p.scene);
  p.render.planes = scene.planes;
  if (scene.gravity.norm() > 0.0) p.render.up = -scene.gravity.normalized();
  return p;
}

}  // namespace calipso::render

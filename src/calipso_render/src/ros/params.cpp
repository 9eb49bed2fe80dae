#include "params.hpp"

#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "calipso_ros/node_main.hpp"

namespace calipso::render {
namespace {

Quality qualityFromString(const std::string& name) {
  if (name == "live") return Quality::kLive;
  if (name == "final") return Quality::kFinal;
  throw std::invalid_argument("parameter quality is '" + name + "'; it must be live or final");
}

template <typename T>
T inRange(const ros::NodeHandle& pnh, const std::string& name, T fallback, T low, T high) {
  const T value = optionalParam(pnh, name, fallback);
  if (!(value >= low && value <= high)) {
    throw std::invalid_argument("parameter " + name + " is " + std::to_string(value) +
                                "; it must lie in " + std::to_string(low) + " .. " +
                                std::to_string(high));
  }
  return value;
}

// @throw std::invalid_argument naming file, size and what it must be
cv::Mat pictureOf(const std::string& path, int type, const Camera& camera) {
  const cv::Mat picture =
      cv::imread(path, type == CV_8U ? cv::IMREAD_GRAYSCALE : cv::IMREAD_UNCHANGED);
  if (picture.type() != type || picture.cols != camera.width || picture.rows != camera.height) {
    throw std::invalid_argument(path + " is no picture of " + std::to_string(camera.width) + " x " +
                                std::to_string(camera.height) + " with one channel of " +
                                (type == CV_8U ? "8" : "16") + " bits; replace or remove it");
  }
  return picture;
}

// A live camera's first frame is not the picture that these were made for.
void loadScenery(const Scene& scene, RenderParams& render) {
  if (!scene.depth_path.empty())
    pictureOf(scene.depth_path, CV_16U, scene.camera)
        .convertTo(render.depth, CV_32F, scene.depth_scale);
  if (!scene.matte_path.empty()) render.matte = pictureOf(scene.matte_path, CV_8U, scene.camera);
}

}  // namespace

NodeParams loadParams(const ros::NodeHandle& pnh) {
  NodeParams p;
  p.scene = loadScene(pathParam(pnh, "scene"));
  p.mode = modeParam(pnh);
  p.render.quality = qualityFromString(optionalParam<std::string>(pnh, "quality", "live"));
  p.render.sun_radius = inRange(pnh, "sun_radius", p.render.sun_radius, 0.0, 0.5);
  p.render.add_noise = optionalParam(pnh, "add_noise", p.render.add_noise);
  p.render.background.mask_margin_px =
      inRange(pnh, "mask_margin_px", p.render.background.mask_margin_px, 0, 31);
  p.clip_samples = inRange(pnh, "clip_samples", p.clip_samples, 2, 200);
  p.live_queue = inRange(pnh, "live_queue", p.live_queue, 1, 1000);
  p.render.planes = p.scene.planes;
  if (p.mode == Mode::kBag) loadScenery(p.scene, p.render);
  if (p.scene.gravity.norm() > 0.0) p.render.up = -p.scene.gravity.normalized();
  return p;
}

}  // namespace calipso::render

#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calipso_render/renderer.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::render {

// The truth of a scene folder, as far as this evaluator needs it. Never read by a node.
struct Truth {
  struct Object {
    ObjectModel model;                     // true shape and pose at frame 0
    std::vector<Eigen::Isometry3d> poses;  // one, or one per frame
    std::vector<Points> shapes;            // per frame, world; empty unless it deforms
    std::optional<double> roughness;       // of the first material slot
  };
  std::vector<Object> objects;
  std::optional<Eigen::Vector3d> to_sun;  // world
};

// @throw std::runtime_error naming file and key
Truth loadTruth(const Scene& scene);

// The same scene in a picture so many times as wide and high: all that is loaded for it below is
// enlarged, too.
Scene enlarged(Scene scene, int times);

// Frame k, CV_8UC3. @throw std::runtime_error naming the file
cv::Mat loadFrame(const Scene& scene, int k);

// Labels of frame k from the true masks (the first frame's where there is only one), CV_8UC1.
cv::Mat loadLabels(const Scene& scene, int k);

// The user's depth image of the key frame, CV_32FC1, m, 0: unknown; empty where the folder has
// none.
cv::Mat loadDepth(const Scene& scene);

// The place without the objects at frame k; nullopt where the folder has none.
std::optional<cv::Mat> loadPlate(const Scene& scene, int k);

// Linear albedo of frame 0, CV_32FC3, 0 where unknown; nullopt where the folder has none.
std::optional<cv::Mat> loadAlbedo(const Scene& scene);

}  // namespace calipso::render

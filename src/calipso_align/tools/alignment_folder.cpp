#include "alignment_folder.hpp"

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <stdexcept>

namespace calipso::align {
namespace {

namespace fs = std::filesystem;

// Reads key by key, and says where a file is wrong.
YAML::Node require(const YAML::Node& node, const std::string& key, const std::string& file) {
  if (!node[key]) throw std::runtime_error(file + ": key '" + key + "' is missing; add it");
  return node[key];
}

ContourLoop readLoop(const std::string& path, bool hole) {
  std::ifstream in(path);
  if (!in) throw std::runtime_error(path + " cannot be read");
  ContourLoop loop;
  loop.hole = hole;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream text(line);
    double u = 0.0, v = 0.0;
    if (!(text >> u >> v)) {
      throw std::runtime_error(path + ":" + std::to_string(number) + ": '" + line +
                               "' is not a pixel (u v)");
    }
    loop.points.emplace_back(u, v);
  }
  loop.known.assign(loop.points.size(), true);
  loop.confidence.assign(loop.points.size(), 1.0f);
  return loop;
}

std::vector<ContourLoop> readContour(const std::string& directory, const std::string& d) {
  std::vector<ContourLoop> loops = {readLoop(directory + "/contour_" + d + ".txt", false)};
  for (int k = 0;; ++k) {
    const std::string hole = directory + "/hole_" + d + "_" + std::to_string(k) + ".txt";
    if (!fs::exists(hole)) return loops;
    loops.push_back(readLoop(hole, true));
  }
}

Camera readCamera(const YAML::Node& node, const std::string& file) {
  Camera camera;
  camera.width = require(node, "width", file).as<int>();
  camera.height = require(node, "height", file).as<int>();
  camera.fx = require(node, "fx", file).as<double>();
  camera.fy = require(node, "fy", file).as<double>();
  camera.cx = require(node, "cx", file).as<double>();
  camera.cy = require(node, "cy", file).as<double>();
  camera.world_from_camera = poseOf(require(node, "world_T_camera", file), file);
  return camera;
}

cv::Mat1b readMask(const std::string& path) {
  const cv::Mat mask = cv::imread(path, cv::IMREAD_GRAYSCALE);
  return mask.empty() ? cv::Mat1b() : cv::Mat1b(mask > 127);
}

}  // namespace

Eigen::Isometry3d poseOf(const YAML::Node& node, const std::string& file) {
  Eigen::Isometry3d pose;
  for (int i = 0; i < 16; ++i) pose.matrix()(i / 4, i % 4) = node[i / 4][i % 4].as<double>();
  const Eigen::Matrix3d R = pose.linear();
  if (!(R * R.transpose()).isIdentity(1e-3)) {
    throw std::runtime_error(file + ": a pose is not a rigid motion");
  }
  pose.linear() = Eigen::Quaterniond(R).normalized().toRotationMatrix();
  return pose;
}

std::vector<EvaluationCase> loadAlignmentFolder(const std::string& directory) {
  const std::string file = directory + "/alignment.yaml";
  const YAML::Node root = YAML::LoadFile(file);
  EvaluationCase base;
  base.name = fs::path(directory).filename();
  base.object = root["shape"] ? root["shape"].as<std::string>() : base.name;
  base.camera = readCamera(require(root, "camera", file), file);
  base.cad = loadMesh(directory + "/S.obj");

  std::vector<EvaluationCase> cases;
  for (const YAML::Node& entry : require(root, "deformations", file)) {
    const std::string d = require(entry, "d", file).as<std::string>();
    EvaluationCase one = base;
    one.deformation_percent = std::stod(d);
    one.rough = poseOf(require(entry, "initial_world_T_object", file), file);
    one.contour = readContour(directory, d);
    Truth truth;
    truth.mesh = loadMesh(directory + "/S_" + d + ".obj");
    truth.correspondence = truth.mesh.vertexCount() == base.cad.vertexCount();
    truth.world_from_object = poseOf(require(entry, "true_world_T_object", file), file);
    truth.contour = one.contour;
    truth.visible = readMask(directory + "/mask_" + d + ".png");
    one.truth = truth;
    cases.push_back(std::move(one));
  }
  return cases;
}

}  // namespace calipso::align

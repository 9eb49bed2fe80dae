#include "truth.hpp"

#include <yaml-cpp/yaml.h>

#include <filesystem>

namespace calipso::flow {
namespace {

Eigen::Vector3d readVector(const YAML::Node& node) {
  return {node[0].as<double>(), node[1].as<double>(), node[2].as<double>()};
}

std::vector<Eigen::Vector3d> readVectors(const YAML::Node& node) {
  std::vector<Eigen::Vector3d> result;
  if (!node || !node.IsSequence()) return result;
  if (node.size() == 3 && node[0].IsScalar()) return {readVector(node)};
  for (const YAML::Node& entry : node) result.push_back(readVector(entry));
  return result;
}

Eigen::Isometry3d readPose(const YAML::Node& node) {
  Eigen::Matrix4d m;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) m(r, c) = node[r][c].as<double>();
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.matrix() = m;
  pose.linear() = Eigen::Quaterniond(m.topLeftCorner<3, 3>()).normalized().toRotationMatrix();
  return pose;
}

TrueObject readObject(const std::string& directory, const YAML::Node& node) {
  TrueObject truth;
  truth.mesh_path = directory + "/" + node["true_mesh"].as<std::string>();
  for (const YAML::Node& pose : node["world_T_object"]) {
    truth.world_from_object.push_back(readPose(pose));
  }
  truth.velocity = readVectors(node["linear_velocity_com"]);
  if (truth.velocity.empty()) truth.velocity = readVectors(node["linear_velocity_per_frame"]);
  truth.spin = readVectors(node["angular_velocity_world"]);
  for (const YAML::Node& c : node["collisions"]) {
    truth.collisions.push_back({c["time_s"].as<double>(), readVector(c["com_velocity_before"]),
                                readVector(c["com_velocity_after"])});
  }
  const std::string mask = directory + "/masks/" + node["name"].as<std::string>() + "_000000.png";
  if (std::filesystem::exists(mask)) truth.mask_path = mask;
  return truth;
}

}  // namespace

std::optional<TrueObject> readTruth(const std::string& directory, const std::string& name) {
  const YAML::Node scene = YAML::LoadFile(directory + "/scene.yaml");
  for (const YAML::Node& node : scene["objects"]) {
    if (node["name"].as<std::string>() != name) continue;
    if (!node["world_T_object"] || !node["true_mesh"]) return std::nullopt;
    return readObject(directory, node);
  }
  return std::nullopt;
}

}  // namespace calipso::flow

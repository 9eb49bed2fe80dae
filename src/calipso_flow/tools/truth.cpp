#include "truth.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "calipso_flow/object_model.hpp"
#include "calipso_scene/triangle_mesh.hpp"

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

// Of the centre of mass, which scenes also call just the velocity.
Eigen::Vector3d readVelocity(const YAML::Node& collision, const std::string& when) {
  const YAML::Node named = collision["com_velocity_" + when];
  return readVector(named ? named : collision["velocity_" + when]);
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

// A NumPy file of 32-bit floats, frames x vertices x 3, in C order.
// @throw std::runtime_error naming file and fault
std::vector<Eigen::MatrixXd> readVertices(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  char magic[8] = {};
  uint16_t length = 0;
  file.read(magic, 8);
  file.read(reinterpret_cast<char*>(&length), 2);
  std::string header(length, ' ');
  file.read(header.data(), length);
  int frames = 0, count = 0;
  const size_t shape = header.find("'shape': (");
  const bool known =
      file && magic[6] == 1 && header.find("'<f4'") != std::string::npos &&
      header.find("'fortran_order': False") != std::string::npos && shape != std::string::npos &&
      std::sscanf(header.c_str() + shape, "'shape': (%d, %d, 3)", &frames, &count) == 2;
  if (!known) throw std::runtime_error(path + " is no array of <f4 with shape (frames, N, 3)");
  std::vector<Eigen::MatrixXd> result;
  Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> values(count, 3);
  for (int k = 0; k < frames; ++k) {
    file.read(reinterpret_cast<char*>(values.data()), sizeof(float) * values.size());
    result.push_back(values.cast<double>());
  }
  if (!file) throw std::runtime_error(path + " ends before its last frame");
  return result;
}

// Central differences of the surface's centre, world axes.
std::vector<Eigen::Vector3d> surfaceVelocity(const TrueObject& truth, double fps) {
  TriangleMesh mesh = loadMesh(truth.mesh_path);
  std::vector<Eigen::Vector3d> centre, velocity;
  for (const Eigen::MatrixXd& vertices : truth.vertices) {
    mesh.vertices = vertices;
    centre.push_back(truth.world_from_object.front() * centroid(mesh));
  }
  for (size_t k = 0; k < centre.size(); ++k) {
    const size_t before = k == 0 ? 0 : k - 1, after = std::min(k + 1, centre.size() - 1);
    velocity.push_back((centre[after] - centre[before]) * fps /
                       std::max<double>(after - before, 1));
  }
  return velocity;
}

TrueObject readObject(const std::string& directory, const YAML::Node& node, double fps) {
  TrueObject truth;
  truth.mesh_path = directory + "/" + node["true_mesh"].as<std::string>();
  for (const YAML::Node& pose : node["world_T_object"]) {
    truth.world_from_object.push_back(readPose(pose));
  }
  truth.velocity = readVectors(node["linear_velocity_com"]);
  if (truth.velocity.empty()) truth.velocity = readVectors(node["linear_velocity_per_frame"]);
  truth.spin = readVectors(node["angular_velocity_world"]);
  for (const YAML::Node& c : node["collisions"]) {
    truth.collisions.push_back(
        {c["time_s"].as<double>(), readVelocity(c, "before"), readVelocity(c, "after")});
  }
  truth.collisions_known = node["collisions"] || truth.world_from_object.size() == 1;
  if (const YAML::Node wave = node["wave"]) {
    truth.wave = {
        wave["om"].as<double>(),
        wave["lean"].as<double>(),
        {wave["sgn"].as<double>() * wave["kx"].as<double>(), 0.0, -wave["kz"].as<double>()}};
  }
  if (const YAML::Node vertices = node["true_vertices_per_frame"]) {
    truth.vertices = readVertices(directory + "/" + vertices.as<std::string>());
    if (truth.velocity.empty()) truth.velocity = surfaceVelocity(truth, fps);
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
    return readObject(directory, node, scene["fps"].as<double>());
  }
  return std::nullopt;
}

}  // namespace calipso::flow

#include "case_reader.hpp"

#include <filesystem>
#include <stdexcept>

namespace calipso::fem {
namespace {

double bound(const std::string& rule) { return std::stod(rule.substr(2)); }

// Young's modulus at a point from rules "x<a" and "x>a".
double modulusAt(const CaseFile& file, const YAML::Node& rules, const Eigen::Vector3d& p) {
  for (const auto& entry : rules) {
    const std::string rule = entry.first.as<std::string>();
    const int axis = rule[0] - 'x';
    if (rule.size() < 3 || axis < 0 || axis > 2 || (rule[1] != '<' && rule[1] != '>'))
      throw std::runtime_error(file.path + ": material.E: rule '" + rule +
                               "' is not of the form x<0.5 or x>0.5");
    if ((rule[1] == '<') == (p[axis] < bound(rule))) return entry.second.as<double>();
  }
  throw std::runtime_error(file.path + ": material.E: no rule covers x = " + std::to_string(p.x()));
}

}  // namespace

YAML::Node CaseFile::at(const std::string& key) const { return require(*this, root, key); }

CaseFile readCase(const std::string& path) {
  CaseFile file;
  file.path = path;
  try {
    file.root = YAML::LoadFile(path);
  } catch (const YAML::Exception& e) {
    throw std::runtime_error(path + ": cannot be read as JSON: " + e.what());
  }
  if (!file.root.IsMap()) throw std::runtime_error(path + ": holds no JSON object");
  file.name = file.root["case"] ? file.root["case"].as<std::string>()
                                : std::filesystem::path(path).stem().string();
  return file;
}

YAML::Node require(const CaseFile& file, const YAML::Node& parent, const std::string& key) {
  const YAML::Node node = parent[key];
  if (!node) throw std::runtime_error(file.path + ": key '" + key + "' is missing");
  return node;
}

Eigen::Vector3d readVector3(const YAML::Node& node) {
  return {node[0].as<double>(), node[1].as<double>(), node[2].as<double>()};
}

Eigen::VectorXd readVector(const YAML::Node& node) {
  if (node.IsScalar()) return scalar(node.as<double>());
  Eigen::VectorXd v(node.size());
  for (std::size_t k = 0; k < node.size(); ++k) v[k] = node[k].as<double>();
  return v;
}

Eigen::MatrixXd readMatrix(const YAML::Node& node) {
  Eigen::MatrixXd m(node.size(), node[0].size());
  for (std::size_t i = 0; i < node.size(); ++i) m.row(i) = readVector(node[i]).transpose();
  return m;
}

Box readBox(const CaseFile& file) {
  const YAML::Node g = file.at("geometry");
  Box box;
  const char* axes[] = {"x", "y", "z"};
  for (int a = 0; a < 3; ++a) {
    const YAML::Node range = require(file, g, axes[a]);
    box.min[a] = range[0].as<double>();
    box.max[a] = range[1].as<double>();
  }
  return box;
}

Material readMaterial(const CaseFile& file) {
  const YAML::Node m = file.at("material");
  Material material;
  const YAML::Node E = require(file, m, "E"), nu = require(file, m, "nu");
  material.youngs_modulus = E.IsMap() ? E.begin()->second.as<double>() : E.as<double>();
  material.poissons_ratio = nu.IsSequence() ? nu[0].as<double>() : nu.as<double>();
  material.density = m["rho"] ? m["rho"].as<double>() : 1.0;
  material.damping = 0.0;
  return material;
}

std::vector<Material> readCellMaterials(const CaseFile& file, const VolumeMesh& mesh) {
  std::vector<Material> materials(mesh.cellCount(), readMaterial(file));
  const YAML::Node E = file.at("material")["E"];
  if (!E.IsMap()) return materials;
  for (int cell = 0; cell < mesh.cellCount(); ++cell) {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    for (int c = 0; c < mesh.cells.cols(); ++c)
      center += mesh.node(mesh.cells(cell, c)) / mesh.cells.cols();
    materials[cell].youngs_modulus = modulusAt(file, E, center);
  }
  return materials;
}

Eigen::Vector3d readGravity(const CaseFile& file) {
  const YAML::Node g = file.root["gravity"];
  return g && g.IsSequence() ? readVector3(g) : Eigen::Vector3d(Eigen::Vector3d::Zero());
}

MaterialModel readModel(const CaseFile& file) {
  return materialModelFromString(file.at("model").as<std::string>());
}

ResultLine lineFor(const CaseFile& file, const std::string& kind, ElementType element,
                   MaterialModel model, int nodes) {
  ResultLine line;
  line.case_name = file.name;
  line.kind = kind;
  line.element = toString(element);
  line.material = toString(model);
  line.nodes = nodes;
  return line;
}

}  // namespace calipso::fem

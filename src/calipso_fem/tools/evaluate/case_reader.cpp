#include "case_reader.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <stdexcept>

namespace calipso::fem {
namespace {

int failed_attempts = 0;

double bound(const CaseFile& file, const std::string& rule) {
  try {
    return std::stod(rule.substr(2));
  } catch (const std::exception&) {
    throw std::runtime_error(file.path + ": material.E: rule '" + rule + "' holds no number");
  }
}

// Value of a node as T. @throw std::runtime_error saying what was expected instead
template <class T>
T valueOf(const YAML::Node& node, const std::string& name, const std::string& expected) {
  try {
    return node.as<T>();
  } catch (const YAML::Exception&) {
    throw std::runtime_error(name + ": expected " + expected);
  }
}

// Young's modulus at a point from rules "x<a" and "x>a".
double modulusAt(const CaseFile& file, const YAML::Node& rules, const Eigen::Vector3d& p) {
  for (const auto& entry : rules) {
    const std::string rule = entry.first.as<std::string>();
    const int axis = rule[0] - 'x';
    if (rule.size() < 3 || axis < 0 || axis > 2 || (rule[1] != '<' && rule[1] != '>'))
      throw std::runtime_error(file.path + ": material.E: rule '" + rule +
                               "' is not of the form x<0.5 or x>0.5");
    if ((rule[1] == '<') == (p[axis] < bound(file, rule)))
      return valueOf<double>(entry.second, file.path + ": material.E", "numbers");
  }
  throw std::runtime_error(file.path + ": material.E: no rule covers (" + std::to_string(p.x()) +
                           ", " + std::to_string(p.y()) + ", " + std::to_string(p.z()) + ")");
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

bool attempt(const std::string& part, const std::function<void()>& work) {
  try {
    work();
    return true;
  } catch (const std::exception& e) {
    const std::string what = e.what();
    const bool named = what.find(part) != std::string::npos;
    std::cerr << "evaluate: " << (named ? "" : part + ": ") << what << "\n";
    ++failed_attempts;
    return false;
  }
}

int failedAttempts() { return failed_attempts; }

double readNumber(const CaseFile& file, const YAML::Node& parent, const std::string& key) {
  return valueOf<double>(require(file, parent, key), file.path + ": " + key, "a number");
}

std::string readText(const CaseFile& file, const YAML::Node& parent, const std::string& key) {
  return valueOf<std::string>(require(file, parent, key), file.path + ": " + key, "text");
}

Eigen::Vector3i readCells(const CaseFile& file, const YAML::Node& parent) {
  Eigen::Vector3i cells;
  const char* keys[] = {"nx", "ny", "nz"};
  for (int a = 0; a < 3; ++a)
    cells[a] = valueOf<int>(require(file, parent, keys[a]), file.path + ": " + keys[a],
                            "a number of cells");
  return cells;
}

Eigen::Vector3d readVector3(const YAML::Node& node) {
  const Eigen::VectorXd v = readVector(node);
  if (v.size() != 3) throw std::runtime_error("a vector of a reference case needs three numbers");
  return v;
}

Eigen::VectorXd readVector(const YAML::Node& node) {
  const std::string name = "a number or vector of a reference case", expected = "numbers";
  if (!node.IsSequence()) return scalar(valueOf<double>(node, name, expected));
  Eigen::VectorXd v(node.size());
  for (std::size_t k = 0; k < node.size(); ++k) v[k] = valueOf<double>(node[k], name, expected);
  return v;
}

Eigen::MatrixXd readMatrix(const YAML::Node& node) {
  if (!node.IsSequence() || node.size() == 0 || !node[0].IsSequence())
    throw std::runtime_error("a matrix of a reference case: expected rows of numbers");
  Eigen::MatrixXd m(node.size(), node[0].size());
  for (std::size_t i = 0; i < node.size(); ++i) {
    const Eigen::VectorXd row = readVector(node[i]);
    if (row.size() != m.cols())
      throw std::runtime_error("a matrix of a reference case: its rows are not equally long");
    m.row(i) = row.transpose();
  }
  return m;
}

std::vector<YAML::Node> sameDiscretisation(const CaseFile& file) {
  YAML::Node list = file.root["same_discretisation"];
  if (list && list.IsMap()) list = list["results"];
  if (!list || !list.IsSequence()) return {};
  return {list.begin(), list.end()};
}

YAML::Node converged(const CaseFile& file) {
  const YAML::Node reference = file.root["reference"];
  return reference ? reference : YAML::Node();
}

std::vector<Eigen::Vector3i> gridsOf(const CaseFile& file) {
  std::vector<Eigen::Vector3i> grids;
  for (const YAML::Node& r : sameDiscretisation(file)) {
    if (!r["nx"] || !r["ny"] || !r["nz"]) continue;
    const Eigen::Vector3i cells = readCells(file, r);
    if (std::find(grids.begin(), grids.end(), cells) == grids.end()) grids.push_back(cells);
  }
  if (!grids.empty()) return grids;
  const Box box = readBox(file);
  const Eigen::Vector3d extent = box.max - box.min;
  for (const int across : {2, 4})
    grids.push_back(
        (extent * across / extent.minCoeff()).array().round().cast<int>().max(1).matrix());
  return grids;
}

Box readBox(const CaseFile& file) {
  const YAML::Node g = file.at("geometry");
  Box box;
  const char* axes[] = {"x", "y", "z"};
  for (int a = 0; a < 3; ++a) {
    const Eigen::VectorXd range = readVector(require(file, g, axes[a]));
    if (range.size() != 2 || !(range[0] < range[1]))
      throw std::runtime_error(file.path + ": geometry." + axes[a] + ": expected [low, high]");
    box.min[a] = range[0];
    box.max[a] = range[1];
  }
  return box;
}

Material readMaterial(const CaseFile& file) {
  const YAML::Node m = file.at("material");
  Material material;
  const YAML::Node E = require(file, m, "E"), nu = require(file, m, "nu");
  material.youngs_modulus = readVector(E.IsMap() ? E.begin()->second : E)[0];
  material.poissons_ratio = readVector(nu)[0];
  material.density = m["rho"] ? readNumber(file, m, "rho") : 1.0;
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
  return materialModelFromString(readText(file, file.root, "model"));
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

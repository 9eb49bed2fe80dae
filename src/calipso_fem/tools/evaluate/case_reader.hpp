#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "calipso_fem/elastic_model.hpp"
#include "result_line.hpp"

namespace calipso::fem {

// A reference case: a JSON file (JSON is YAML).
struct CaseFile {
  std::string path, name;
  YAML::Node root;

  // @throw std::runtime_error naming file and key when the key is missing
  YAML::Node at(const std::string& key) const;
};

CaseFile readCase(const std::string& path);

// Runs one part of an evaluation; when it throws, standard error names the part and what is wrong.
// Returns whether it went through.
bool attempt(const std::string& part, const std::function<void()>& work);
// How many attempts have failed so far.
int failedAttempts();

// @throw std::runtime_error naming file, key and what was expected
YAML::Node require(const CaseFile& file, const YAML::Node& parent, const std::string& key);
double readNumber(const CaseFile& file, const YAML::Node& parent, const std::string& key);
std::string readText(const CaseFile& file, const YAML::Node& parent, const std::string& key);
// nx, ny, nz of a grid.
Eigen::Vector3i readCells(const CaseFile& file, const YAML::Node& parent);

// The same of nodes that are known to exist. @throw std::runtime_error
Eigen::Vector3d readVector3(const YAML::Node& node);
Eigen::VectorXd readVector(const YAML::Node& node);
Eigen::MatrixXd readMatrix(const YAML::Node& node);

// Every entry of "same_discretisation": {"results": [...]} or [...]; empty when there is none.
std::vector<YAML::Node> sameDiscretisation(const CaseFile& file);
// The finest solution, null when the file has none.
YAML::Node converged(const CaseFile& file);
// The grids of those entries, each once; where there are none, two and four cells across the box.
std::vector<Eigen::Vector3i> gridsOf(const CaseFile& file);

// The box [x, y, z] of "geometry".
struct Box {
  Eigen::Vector3d min, max;
};
Box readBox(const CaseFile& file);

// E, nu, rho of "material"; density 1 and E of the first part where not given.
Material readMaterial(const CaseFile& file);
// One material per cell: "E" may be {"x<a": E1, "x>a": E2}, decided at the cell's centre.
std::vector<Material> readCellMaterials(const CaseFile& file, const VolumeMesh& mesh);
Eigen::Vector3d readGravity(const CaseFile& file);
MaterialModel readModel(const CaseFile& file);

// Values to print with every line of a case.
ResultLine lineFor(const CaseFile& file, const std::string& kind, ElementType element,
                   MaterialModel model, int nodes);

}  // namespace calipso::fem

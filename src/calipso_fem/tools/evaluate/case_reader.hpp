#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
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

YAML::Node require(const CaseFile& file, const YAML::Node& parent, const std::string& key);
Eigen::Vector3d readVector3(const YAML::Node& node);
Eigen::VectorXd readVector(const YAML::Node& node);
Eigen::MatrixXd readMatrix(const YAML::Node& node);

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

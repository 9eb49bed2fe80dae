#include "yaml_reading.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <stdexcept>

namespace calipso {

namespace {

std::string describe(const YAML::Node& node) {
  YAML::Node in_one_line = YAML::Clone(node);
  in_one_line.SetStyle(YAML::EmitterStyle::Flow);
  std::ostringstream text;
  text << in_one_line;
  return text.str().substr(0, 80);
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace

YAML::Node YamlReader::load(const std::string& path) {
  try {
    return YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    throw std::runtime_error(path + ": cannot be opened; check the path and the permissions");
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(path + ": is not valid YAML: " + error.what());
  }
}

void YamlReader::fail(const std::string& key, const std::string& what) const {
  throw std::invalid_argument(path_ + ": " + context_ + (context_.empty() ? "" : ": ") + key +
                              (key.empty() ? "" : " ") + what);
}

YAML::Node YamlReader::require(const YAML::Node& node, const std::string& key) const {
  if (!node.IsDefined() || !node.IsMap() || !node[key]) fail(key, "is missing; add it");
  return node[key];
}

std::vector<YAML::Node> YamlReader::list(const YAML::Node& node, const std::string& key) const {
  const YAML::Node value = node[key];
  if (!value || value.IsNull()) return {};
  if (!value.IsSequence())
    fail(key, "is '" + describe(value) + "'; it must be a list: put \"- \" before each entry");
  return {value.begin(), value.end()};
}

double YamlReader::numberOrInfinity(const YAML::Node& node, const std::string& key) const {
  const YAML::Node value = require(node, key);
  double result = 0.0;
  if (!value.IsScalar() || !YAML::convert<double>::decode(value, result) || std::isnan(result)) {
    fail(key, "is '" + describe(value) + "'; it must be a number");
  }
  return result;
}

double YamlReader::number(const YAML::Node& node, const std::string& key) const {
  const double result = numberOrInfinity(node, key);
  if (std::isinf(result)) fail(key, "is '" + describe(node[key]) + "'; it must be finite");
  return result;
}

double YamlReader::positive(const YAML::Node& node, const std::string& key,
                            const std::string& unit) const {
  const double value = number(node, key);
  if (value <= 0.0) fail(key, "is " + describe(node[key]) + "; it must be > 0 " + unit);
  return value;
}

int YamlReader::integer(const YAML::Node& node, const std::string& key) const {
  const double value = number(node, key);
  if (value != std::floor(value) || std::abs(value) > 1e9) {
    fail(key, "is " + describe(node[key]) + "; it must be a whole number");
  }
  return static_cast<int>(value);
}

bool YamlReader::yes(const YAML::Node& node, const std::string& key) const {
  const YAML::Node value = require(node, key);
  bool result = false;
  if (!value.IsScalar() || !YAML::convert<bool>::decode(value, result)) {
    fail(key, "is '" + describe(value) + "'; it must be true or false");
  }
  return result;
}

std::string YamlReader::text(const YAML::Node& node, const std::string& key) const {
  const YAML::Node value = require(node, key);
  if (!value.IsScalar()) fail(key, "is '" + describe(value) + "'; it must be a text");
  return value.Scalar();
}

Eigen::VectorXd YamlReader::vector(const YAML::Node& node, const std::string& key, int size) const {
  const YAML::Node value = require(node, key);
  const std::string wanted = "it must be a list of " + std::to_string(size) + " numbers";
  if (!value.IsSequence() || static_cast<int>(value.size()) != size) {
    fail(key, "is '" + describe(value) + "'; " + wanted);
  }
  Eigen::VectorXd result(size);
  for (int i = 0; i < size; ++i) {
    if (!YAML::convert<double>::decode(value[i], result[i]) || !std::isfinite(result[i])) {
      fail(key, "is '" + describe(value) + "'; " + wanted + ", all finite");
    }
  }
  return result;
}

Eigen::Isometry3d YamlReader::pose(const YAML::Node& node, const std::string& key) const {
  const YAML::Node value = require(node, key);
  if (!value.IsSequence() || value.size() != 4) fail(key, "must be a 4x4 matrix, a list of 4 rows");
  Eigen::Matrix4d matrix;
  for (int row = 0; row < 4; ++row) {
    YAML::Node wrapped;
    wrapped[key] = value[row];
    matrix.row(row) = vector(wrapped, key, 4).transpose();
  }
  constexpr double kRotationTolerance = 1e-4;  // files hold six or more digits
  const Eigen::Matrix3d r = matrix.topLeftCorner<3, 3>();
  if ((r * r.transpose() - Eigen::Matrix3d::Identity()).norm() > kRotationTolerance ||
      r.determinant() < 0.0) {
    fail(key, "is not a rigid transform; its upper left 3x3 block must be a rotation");
  }
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.linear() = Eigen::Quaterniond(r).normalized().toRotationMatrix();
  result.translation() = matrix.topRightCorner<3, 1>();
  return result;
}

void YamlReader::checkKeys(const YAML::Node& node, const std::vector<std::string>& known) const {
  std::set<std::string> seen;
  for (const auto& entry : node) {
    const std::string key = entry.first.as<std::string>();
    if (std::find(known.begin(), known.end(), key) == known.end())
      fail(key, "is not a known key; known ones are " + joined(known));
    if (!seen.insert(key).second)
      fail(key, "is given twice; only one of them would count: leave one out");
  }
}

}  // namespace calipso

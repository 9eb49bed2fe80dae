#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <string>
#include <vector>

namespace calipso {

// Reads values from one YAML file; every error names file, key, what is wrong and the remedy.
class YamlReader {
 public:
  // @throw std::runtime_error if the file cannot be read or is not YAML
  static YAML::Node load(const std::string& path);

  YamlReader(std::string path, std::string context) : path_(std::move(path)), context_(context) {}

  [[noreturn]] void fail(const std::string& key, const std::string& what) const;

  // The entries of the list under key, none where there is none or it is empty.
  // @throw std::invalid_argument if it is no list
  std::vector<YAML::Node> list(const YAML::Node& node, const std::string& key) const;

  // All of these: @throw std::invalid_argument if absent, of another type or not finite.
  double number(const YAML::Node& node, const std::string& key) const;
  double numberOrInfinity(const YAML::Node& node, const std::string& key) const;  // .inf, too
  int integer(const YAML::Node& node, const std::string& key) const;
  bool yes(const YAML::Node& node, const std::string& key) const;
  // ... or not above zero; `unit` for the message.
  double positive(const YAML::Node& node, const std::string& key, const std::string& unit) const;
  std::string text(const YAML::Node& node, const std::string& key) const;
  Eigen::VectorXd vector(const YAML::Node& node, const std::string& key, int size) const;
  Eigen::Isometry3d pose(const YAML::Node& node, const std::string& key) const;

  // The value under key where there is one, else `otherwise`.
  double number(const YAML::Node& node, const std::string& key, double otherwise) const {
    return node[key] ? number(node, key) : otherwise;
  }
  std::string text(const YAML::Node& node, const std::string& key, const char* otherwise) const {
    return node[key] ? text(node, key) : otherwise;
  }

  // @throw std::invalid_argument for a key of `node` that is not among `known`, or twice there
  void checkKeys(const YAML::Node& node, const std::vector<std::string>& known) const;

 private:
  YAML::Node require(const YAML::Node& node, const std::string& key) const;

  std::string path_;
  std::string context_;
};

}  // namespace calipso

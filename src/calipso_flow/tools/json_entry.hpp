#pragma once

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

namespace calipso::flow {

// One flat JSON object, built key by key. Numbers that are not finite become null.
class JsonEntry {
 public:
  JsonEntry& text(const std::string& key, const std::string& value) {
    return raw(key, "\"" + value + "\"");
  }
  JsonEntry& number(const std::string& key, double value) { return raw(key, format(value)); }
  JsonEntry& flag(const std::string& key, bool value) { return raw(key, value ? "true" : "false"); }
  JsonEntry& null(const std::string& key) { return raw(key, "null"); }
  JsonEntry& numbers(const std::string& key, const std::vector<double>& values) {
    std::string list;
    for (double value : values) list += (list.empty() ? "" : ", ") + format(value);
    return raw(key, "[" + list + "]");
  }
  std::string str() const { return "{" + body_ + "}"; }

 private:
  static std::string format(double value) {
    if (!std::isfinite(value)) return "null";
    char buffer[32];
    std::snprintf(buffer, sizeof buffer, "%.6g", value);
    return buffer;
  }
  JsonEntry& raw(const std::string& key, const std::string& value) {
    body_ += (body_.empty() ? "\"" : ", \"") + key + "\": " + value;
    return *this;
  }
  std::string body_;
};

}  // namespace calipso::flow

#include "calipso_bag/arguments.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "calipso_scene/help.hpp"

namespace calipso::bag {
namespace {

bool contains(const std::vector<std::string>& list, const std::string& word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

}  // namespace

Arguments::Arguments(int argc, char** argv, int positional, const std::vector<std::string>& keys,
                     const std::vector<std::string>& flags, const std::string& usage) {
  helpIfAsked(argc, argv, usage);
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word.rfind("--", 0) != 0) {
      words_.push_back(word);
    } else if (contains(flags, word.substr(2))) {
      values_[word.substr(2)] = "";
    } else if (!contains(keys, word.substr(2))) {
      throw std::invalid_argument("unknown option " + word + "\n" + usage);
    } else if (++i == argc) {
      throw std::invalid_argument("option " + word + " needs a value\n" + usage);
    } else {
      values_[word.substr(2)] = argv[i];
    }
  }
  if (static_cast<int>(words_.size()) != positional) throw std::invalid_argument(usage);
}

std::string Arguments::text(const std::string& key, const std::string& fallback) const {
  const auto found = values_.find(key);
  return found == values_.end() ? fallback : found->second;
}

double Arguments::number(const std::string& key, double fallback) const {
  if (!has(key)) return fallback;
  const std::string& value = values_.at(key);
  std::size_t used = 0;
  double number = 0.0;
  try {
    number = std::stod(value, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used == 0 || used != value.size()) {
    throw std::invalid_argument("--" + key + " " + value + ": not a number");
  }
  return number;
}

double Arguments::positive(const std::string& key, double fallback) const {
  const double value = number(key, fallback);
  if (has(key) && !(value > 0.0 && std::isfinite(value)))
    throw std::invalid_argument("--" + key + " " + values_.at(key) + ": give a number above 0");
  return value;
}

}  // namespace calipso::bag

#pragma once

#include <map>
#include <string>
#include <vector>

namespace calipso::bag {

// A command line of positional words, `--key value` pairs and `--flag`s.
class Arguments {
 public:
  // `keys` take a value, `flags` do not. --help prints `usage` and ends the program.
  // @throw std::invalid_argument with `usage` when a key is unknown, lacks its value, or the number
  // of positional words is not `positional`
  Arguments(int argc, char** argv, int positional, const std::vector<std::string>& keys,
            const std::vector<std::string>& flags, const std::string& usage);

  const std::string& word(int i) const { return words_.at(i); }
  bool has(const std::string& key) const { return values_.count(key) > 0; }
  std::string text(const std::string& key, const std::string& fallback) const;

  // @throw std::invalid_argument when the value is not a number
  double number(const std::string& key, double fallback) const;
  // @throw std::invalid_argument when the value is not a number above 0
  double positive(const std::string& key, double fallback) const;

 private:
  std::vector<std::string> words_;
  std::map<std::string, std::string> values_;
};

}  // namespace calipso::bag

#pragma once

#include <exception>
#include <iostream>
#include <string>

namespace calipso::align {

// What every evaluator's main() does: a case that cannot be read is named and passed over.
// @param parse     arguments from argc, argv, with member `paths`; throws with the usage
// @param evaluate  one path
// @return exit code: 0 all done, 1 some case failed, 2 wrong arguments
template <class Parse, class Evaluate>
int runEvaluation(int argc, char** argv, const Parse& parse, const Evaluate& evaluate) {
  int failed = 0;
  try {
    const auto arguments = parse(argc, argv);
    for (const std::string& path : arguments.paths) {
      try {
        evaluate(path, arguments);
      } catch (const std::exception& error) {
        std::cerr << path << ": " << error.what() << "\n";
        ++failed;
      }
    }
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 2;
  }
  return failed > 0 ? 1 : 0;
}

}  // namespace calipso::align

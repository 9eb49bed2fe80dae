#pragma once

#include <cstdlib>
#include <iostream>
#include <string>

namespace calipso {

// Prints what a command line tool takes and ends the program well, if that is asked for.
inline void helpIfAsked(int argc, char** argv, const std::string& usage) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word != "--help" && word != "-h") continue;
    std::cout << usage << std::flush;
    std::exit(0);
  }
}

}  // namespace calipso

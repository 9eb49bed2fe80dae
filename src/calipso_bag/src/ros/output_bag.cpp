#include "output_bag.hpp"

#include <filesystem>
#include <stdexcept>

namespace calipso::bag {

namespace fs = std::filesystem;

OutputBag::OutputBag(const std::string& path) : path_(path), active_path_(path + ".active") {
  if (path.empty()) throw std::invalid_argument("the output bag's path is empty; give one");
  try {
    const fs::path folder = fs::path(path).parent_path();
    if (!folder.empty()) fs::create_directories(folder);
    bag_.open(active_path_, rosbag::bagmode::Write);
  } catch (const std::exception& e) {
    throw std::runtime_error(path + ": cannot be written (" + e.what() +
                             "); choose a folder that is yours");
  }
}

void OutputBag::finish() {
  try {
    bag_.close();
    fs::rename(active_path_, path_);
  } catch (const std::exception& e) {
    throw std::runtime_error(path_ + ": cannot be completed (" + e.what() + ")");
  }
}

}  // namespace calipso::bag

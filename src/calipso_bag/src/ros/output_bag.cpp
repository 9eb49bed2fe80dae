#include "output_bag.hpp"

#include <filesystem>
#include <stdexcept>

namespace calipso::bag {

namespace fs = std::filesystem;

OutputBag::OutputBag(const std::string& path, const std::vector<std::string>& inputs)
    : path_(path), active_path_(path + ".active"), bag_(std::make_unique<rosbag::Bag>()) {
  if (path.empty()) throw std::invalid_argument("the output bag's path is empty; give one");
  std::error_code none;
  if (!fs::path(path).has_filename() || fs::is_directory(path, none))
    throw std::invalid_argument(path + ": is a folder; give the path of the bag to be written");
  for (const std::string& input : inputs) {
    for (const std::string& written : {path_, active_path_}) {
      if (fs::equivalent(written, input, none))
        throw std::invalid_argument(written + ": is read; give another path to be written than " +
                                    path);
    }
  }
  try {
    const fs::path folder = fs::path(path).parent_path();
    if (!folder.empty()) fs::create_directories(folder);
    bag_->open(active_path_, rosbag::bagmode::Write);
  } catch (const std::exception& e) {
    abandon();
    failWriting(e, "choose a folder that is yours");
  }
}

OutputBag::~OutputBag() {
  abandon();
  std::error_code none;
  if (empty_) fs::remove(active_path_, none);
}

// NOTE: where a bag cannot be closed, its destructor would try again, and throw.
void OutputBag::abandon() {
  try {
    bag_->close();
  } catch (const std::exception&) {
    static_cast<void>(bag_.release());
  }
}

void OutputBag::failWriting(const std::exception& error, const std::string& remedy) const {
  throw std::runtime_error(path_ + ": cannot be written (" + error.what() + "); " + remedy);
}

void OutputBag::finish() {
  try {
    bag_->close();
  } catch (const std::exception& e) {
    failWriting(e, kMakeRoom);
  }
  try {
    fs::rename(active_path_, path_);
  } catch (const std::exception& e) {
    failWriting(e, "the whole bag is there as " + active_path_ + ": rename it");
  }
}

}  // namespace calipso::bag

#pragma once

#include <rosbag/bag.h>

#include <string>

namespace calipso::bag {

// A bag that appears under its name only when it is complete: it grows as PATH.active and is
// renamed by finish(). Whatever ends the program earlier leaves PATH untouched.
class OutputBag {
 public:
  // Makes missing folders. @throw std::runtime_error when the file cannot be written
  explicit OutputBag(const std::string& path);

  rosbag::Bag& bag() { return bag_; }
  const std::string& path() const { return path_; }

  // Closes and renames. @throw std::runtime_error
  void finish();

 private:
  std::string path_, active_path_;
  rosbag::Bag bag_;
};

}  // namespace calipso::bag

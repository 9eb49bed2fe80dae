#pragma once

#include <rosbag/bag.h>

#include <exception>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace calipso::bag {

// A bag that appears under its name only when it is complete: it grows as PATH.active and is
// renamed by finish(). Whatever ends the program earlier leaves PATH untouched, and PATH.active
// closed, or gone when nothing was written.
class OutputBag {
 public:
  // Makes missing folders. Neither PATH nor PATH.active may be one of the files that are read.
  // @throw std::runtime_error when the file cannot be written
  explicit OutputBag(const std::string& path, const std::vector<std::string>& inputs = {});

  ~OutputBag();
  OutputBag(const OutputBag&) = delete;
  OutputBag& operator=(const OutputBag&) = delete;

  // As rosbag::Bag's. @throw std::runtime_error, for one when the disk is full
  template <typename... Arguments>
  void write(Arguments&&... arguments) {
    try {
      bag_->write(std::forward<Arguments>(arguments)...);
      empty_ = false;
    } catch (const rosbag::BagException& e) {
      failWriting(e, kMakeRoom);
    }
  }
  const std::string& path() const { return path_; }

  // Closes and renames. @throw std::runtime_error
  void finish();

 private:
  static constexpr char kMakeRoom[] = "make room on the disk, or choose another folder";

  void abandon();
  [[noreturn]] void failWriting(const std::exception& error, const std::string& remedy) const;

  std::string path_, active_path_;
  std::unique_ptr<rosbag::Bag> bag_;
  bool empty_ = true;
};

}  // namespace calipso::bag

#pragma once

#include <rosbag/bag.h>

#include <string>

namespace calipso::bag {

// @throw std::runtime_error naming the file and the remedy
void openForReading(rosbag::Bag& bag, const std::string& path);

}  // namespace calipso::bag

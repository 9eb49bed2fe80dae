#pragma once

#include <rosbag/bag.h>

#include <stdexcept>
#include <string>

namespace calipso::bag {

// @throw std::runtime_error naming the file and the remedy
void openForReading(rosbag::Bag& bag, const std::string& path);

// What to throw for what rosbag threw while messages of an open bag were read.
std::runtime_error damaged(const std::string& path, const rosbag::BagException& error);

}  // namespace calipso::bag

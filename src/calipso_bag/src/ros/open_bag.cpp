#include "open_bag.hpp"

#include <stdexcept>

namespace calipso::bag {

void openForReading(rosbag::Bag& bag, const std::string& path) {
  try {
    bag.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagUnindexedException&) {
    throw std::runtime_error(path +
                             ": the bag has no index, so its recording was cut short; "
                             "'rosbag reindex' recovers what is readable");
  } catch (const rosbag::BagException& e) {
    throw std::runtime_error(path + ": cannot be read as a bag (" + e.what() +
                             "); check the path, or recover it with 'rosbag reindex'");
  }
}

}  // namespace calipso::bag

#include "open_bag.hpp"

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

std::runtime_error damaged(const std::string& path, const rosbag::BagException& error) {
  return std::runtime_error(path + ": damaged (" + error.what() +
                            "); copy it anew, or keep what comes before the damage with "
                            "'rosbag reindex -f'");
}

}  // namespace calipso::bag

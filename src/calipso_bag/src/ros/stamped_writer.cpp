#include "stamped_writer.hpp"

namespace calipso::bag {

void StampedWriter::flush(const ros::Time& up_to) {
  while (!waiting_.empty() && std::get<ros::Time>(waiting_.begin()->first) <= up_to) {
    waiting_.begin()->second(output_);
    waiting_.erase(waiting_.begin());
  }
}

void StampedWriter::flushAll() { flush(ros::TIME_MAX); }

}  // namespace calipso::bag

#pragma once

#include <cstdint>
#include <deque>

namespace calipso::bag {

// The frames that were sent and have not come back: never more than `capacity`, and they come back
// in the order in which they were sent. A frame is known by its stamp, ns.
class FlightWindow {
 public:
  // @throw std::invalid_argument when capacity < 1
  explicit FlightWindow(int capacity);

  bool hasRoom() const { return static_cast<int>(in_flight_.size()) < capacity_; }
  bool empty() const { return in_flight_.empty(); }
  int returned() const { return returned_; }

  // @pre hasRoom()
  void sent(std::int64_t stamp_ns);

  // @throw std::runtime_error when this is not the frame that has been away longest
  void cameBack(std::int64_t stamp_ns);

 private:
  int capacity_;
  int returned_ = 0;
  std::deque<std::int64_t> in_flight_;
};

}  // namespace calipso::bag

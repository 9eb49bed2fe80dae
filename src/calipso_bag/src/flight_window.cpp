#include "calipso_bag/flight_window.hpp"

#include <cassert>
#include <stdexcept>
#include <string>

namespace calipso::bag {
namespace {

std::string seconds(std::int64_t ns) { return std::to_string(1e-9 * static_cast<double>(ns)); }

}  // namespace

FlightWindow::FlightWindow(int capacity) : capacity_(capacity) {
  if (capacity < 1) {
    throw std::invalid_argument("frames in flight: " + std::to_string(capacity) +
                                " is less than 1");
  }
}

void FlightWindow::sent(std::int64_t stamp_ns) {
  assert(hasRoom());
  in_flight_.push_back(stamp_ns);
}

void FlightWindow::cameBack(std::int64_t stamp_ns) {
  if (in_flight_.empty() || in_flight_.front() != stamp_ns) {
    const std::string due = in_flight_.empty() ? "none" : seconds(in_flight_.front()) + " s";
    throw std::runtime_error("the edited frame of " + seconds(stamp_ns) + " s came where " + due +
                             " was due; a frame was lost, or a second renderer is running");
  }
  in_flight_.pop_front();
  ++returned_;
}

}  // namespace calipso::bag

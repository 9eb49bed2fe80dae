#pragma once

#include <functional>

namespace calipso::bag {

// Works off callbacks until `done()`, but for at most `timeout_sec` of wall time; returns done().
// Callbacks run in the calling thread; an exception thrown by one of them ends the wait.
// @throw std::runtime_error when ROS is shut down meanwhile
bool waitFor(const std::function<bool()>& done, double timeout_sec);

}  // namespace calipso::bag

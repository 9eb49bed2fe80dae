#pragma once

#include <sys/types.h>

#include <chrono>
#include <vector>

namespace calipso::bag {

// Ends the roslaunch that started this process, so that its exit status is not 0.
//
// roslaunch exits with 0 whatever its nodes return, and catches the signals that could tell it
// otherwise. When the parent process is a roslaunch it is killed first, because it would turn the
// death of a required node into a clean exit; its other children (nodes, master, rosout), which it
// can then no longer stop, are asked to end; one that has not after as long as roslaunch would wait
// is ended. Returns when none is left. Without such a parent this does nothing.
void failLaunch();

// Asks processes to end (SIGINT), and ends those that have not after `grace` (SIGKILL).
// @return those that the system has not taken away 5 s after that: blocked in a device
std::vector<pid_t> endAll(std::vector<pid_t> processes, std::chrono::milliseconds grace);

}  // namespace calipso::bag

#include "calipso_bag/launch_guard.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

namespace calipso::bag {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

// A process that waits for signals; SIGINT ends it, or is not heard. It exists with that choice
// made, whatever a shell that has put this test into the background has chosen for it.
pid_t startWaiting(bool stubborn) {
  const auto before = signal(SIGINT, stubborn ? SIG_IGN : SIG_DFL);
  const pid_t process = fork();
  if (process == 0) {
    while (true) pause();
  }
  signal(SIGINT, before);
  return process;
}

bool runs(pid_t process) { return waitpid(process, nullptr, WNOHANG) == 0; }

// The signal that has ended a process; 0, and it is ended, if none has.
int endedBy(pid_t process) {
  int status = 0;
  if (waitpid(process, &status, WNOHANG) == process)
    return WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  kill(process, SIGKILL);
  waitpid(process, &status, 0);
  return 0;
}

TEST(LaunchGuard, ProcessesThatListenAreAsked) {
  const pid_t process = startWaiting(false);
  EXPECT_TRUE(endAll({process}, 60s).empty());
  EXPECT_EQ(endedBy(process), SIGINT);
}

TEST(LaunchGuard, ReturnsWhenStubbornProcessesHaveEnded) {
  const std::vector<pid_t> processes = {startWaiting(true), startWaiting(false)};
  EXPECT_TRUE(endAll(processes, 100ms).empty());
  EXPECT_EQ(endedBy(processes[0]), SIGKILL);
  EXPECT_EQ(endedBy(processes[1]), SIGINT);
}

// Whoever runs this test was not started by roslaunch.
TEST(LaunchGuard, WithoutRoslaunchNothingIsEnded) {
  const pid_t sibling = startWaiting(false);
  failLaunch();
  EXPECT_TRUE(runs(sibling));
  endAll({sibling}, 60s);
  EXPECT_EQ(endedBy(sibling), SIGINT);
}

}  // namespace
}  // namespace calipso::bag

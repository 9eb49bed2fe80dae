#include "calipso_bag/launch_guard.hpp"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <utility>

namespace calipso::bag {
namespace {

namespace fs = std::filesystem;

// True when one of the first two words of the command line is a program called roslaunch (the
// first, or the script that an interpreter runs).
bool isRoslaunch(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/cmdline", std::ios::binary);
  std::string word;
  for (int i = 0; i < 2 && std::getline(file, word, '\0'); ++i) {
    if (fs::path(word).filename() == "roslaunch") return true;
  }
  return false;
}

struct ProcessStat {
  char state = 0;  // 'Z': has ended, nobody has asked for its status
  pid_t parent = 0;
};

// From the fields after the parenthesised command name in /proc/PID/stat; nothing once it is gone.
std::optional<ProcessStat> statOf(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::size_t name_end = text.rfind(')');
  if (name_end == std::string::npos) return std::nullopt;
  std::istringstream fields(text.substr(name_end + 1));
  ProcessStat stat;
  fields >> stat.state >> stat.parent;
  return stat;
}

// All but this one.
std::vector<pid_t> siblings(pid_t parent) {
  std::vector<pid_t> children;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    const pid_t process = std::stoi(name);
    const std::optional<ProcessStat> stat = statOf(process);
    if (stat && stat->parent == parent && process != getpid()) children.push_back(process);
  }
  return children;
}

void dropEnded(std::vector<pid_t>& processes) {
  const auto ended = [](pid_t process) {
    const std::optional<ProcessStat> stat = statOf(process);
    return !stat || stat->state == 'Z';
  };
  processes.erase(std::remove_if(processes.begin(), processes.end(), ended), processes.end());
}

// Those that have not ended when the time is over.
std::vector<pid_t> awaitEnd(std::vector<pid_t> processes, std::chrono::milliseconds time) {
  const auto end = std::chrono::steady_clock::now() + time;
  for (dropEnded(processes); !processes.empty(); dropEnded(processes)) {
    if (std::chrono::steady_clock::now() > end) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return processes;
}

void signalAll(const std::vector<pid_t>& processes, int signal) {
  for (const pid_t process : processes) kill(process, signal);
}

}  // namespace

std::vector<pid_t> endAll(std::vector<pid_t> processes, std::chrono::milliseconds grace) {
  signalAll(processes, SIGINT);  // roscpp hears no other signal
  processes = awaitEnd(std::move(processes), grace);
  signalAll(processes, SIGKILL);
  return awaitEnd(std::move(processes), std::chrono::seconds(5));
}

void failLaunch() {
  const pid_t parent = getppid();
  if (!isRoslaunch(parent)) return;
  const std::vector<pid_t> others = siblings(parent);
  kill(parent, SIGKILL);
  endAll(others, std::chrono::seconds(15));  // as roslaunch has it
}

}  // namespace calipso::bag

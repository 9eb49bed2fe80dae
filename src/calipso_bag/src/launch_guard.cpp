#include "calipso_bag/launch_guard.hpp"

#include <signal.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

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

// Parent of a process: the second field after the parenthesised command name in /proc/PID/stat.
pid_t parentOf(const std::string& process) {
  std::ifstream file("/proc/" + process + "/stat");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::size_t name_end = text.rfind(')');
  if (name_end == std::string::npos) return 0;
  std::istringstream fields(text.substr(name_end + 1));
  char state = 0;
  pid_t parent = 0;
  fields >> state >> parent;
  return parent;
}

std::vector<pid_t> childrenOf(pid_t parent) {
  std::vector<pid_t> children;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    if (parentOf(name) == parent) children.push_back(std::stoi(name));
  }
  return children;
}

}  // namespace

void failLaunch() {
  const pid_t parent = getppid();
  if (!isRoslaunch(parent)) return;
  const std::vector<pid_t> children = childrenOf(parent);
  kill(parent, SIGKILL);
  for (const pid_t child : children) {
    if (child != getpid()) kill(child, SIGINT);  // roscpp closes down on no other signal
  }
}

}  // namespace calipso::bag

#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "calipso_bag/arguments.hpp"
#include "calipso_bag/rviz_view.hpp"
#include "calipso_ros/params.hpp"
#include "ros/guarded_main.hpp"

using namespace calipso;
using namespace calipso::bag;

namespace {

constexpr char kUsage[] =
    "usage: look_on SCENE_DIR --config FILE.rviz [NAME:=VALUE ...]\n"
    "  opens rviz with this configuration, but for view, grid and axes, which are as suits the\n"
    "  scene's size; names are mapped as by any node";

std::string contentOf(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + " cannot be read");
  return {std::istreambuf_iterator<char>(file), {}};
}

// Where ROS keeps what is made anew in each run.
std::string pathOfMade() {
  const char *ros = std::getenv("ROS_HOME"), *home = std::getenv("HOME");
  const std::filesystem::path folder =
      ros ? std::filesystem::path(ros) : std::filesystem::path(home ? home : "/tmp") / ".ros";
  std::filesystem::create_directories(folder);
  return folder / "calipso.rviz";
}

std::string makeConfig(const Arguments& arguments) {
  if (!arguments.has("config")) throw std::invalid_argument(kUsage);
  const std::string made = pathOfMade();
  std::ofstream file(made);
  file << rvizConfigFor(loadScene(absolutePath(arguments.word(0))),
                        contentOf(absolutePath(arguments.text("config", ""))))
       << "\n";
  if (!file.flush()) throw std::runtime_error(made + " cannot be written");
  return made;
}

// Becomes rviz, so that who ends this program ends rviz.
void lookOn(int argc, char** argv) {
  std::vector<char*> words, names;
  for (int i = 0; i < argc; ++i)
    (i > 0 && std::strstr(argv[i], ":=") ? names : words).push_back(argv[i]);
  const Arguments arguments(static_cast<int>(words.size()), words.data(), 1, {"config"}, {},
                            kUsage);
  std::string config = makeConfig(arguments);
  std::string program = "rviz", option = "-d";
  std::vector<char*> command = {program.data(), option.data(), config.data()};
  command.insert(command.end(), names.begin(), names.end());
  command.push_back(nullptr);
  execvp(program.c_str(), command.data());
  throw std::runtime_error("rviz cannot be started: " + std::string(std::strerror(errno)));
}

}  // namespace

int main(int argc, char** argv) {
  return runTool([&] { lookOn(argc, argv); });
}

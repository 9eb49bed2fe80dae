#include "calipso_ros/node_main.hpp"
#include "ros/align_ros.hpp"

int main(int argc, char** argv) {
  return calipso::runNode<calipso::align::AlignRos>(argc, argv, "align");
}

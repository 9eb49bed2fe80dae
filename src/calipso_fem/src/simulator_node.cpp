#include "calipso_ros/node_main.hpp"
#include "ros/simulator_ros.hpp"

int main(int argc, char** argv) {
  return calipso::runNode<calipso::fem::SimulatorRos>(argc, argv, "simulator");
}

#include "calipso_ros/node_main.hpp"
#include "ros/flow_ros.hpp"

int main(int argc, char** argv) {
  return calipso::runNode<calipso::flow::FlowNode>(argc, argv, "flow");
}

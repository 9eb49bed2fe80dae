#include "calipso_ros/node_main.hpp"
#include "ros/segmentation_ros.hpp"

int main(int argc, char** argv) {
  return calipso::runNode<calipso::align::SegmentationRos>(argc, argv, "segmentation");
}

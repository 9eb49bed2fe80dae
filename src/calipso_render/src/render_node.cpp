#include "calipso_ros/node_main.hpp"
#include "ros/render_ros.hpp"

int main(int argc, char** argv) {
  return calipso::runNode<calipso::render::RenderNode>(argc, argv, "render");
}

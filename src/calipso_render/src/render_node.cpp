#include "calipso_render/memory.hpp"
#include "calipso_ros/node_main.hpp"
#include "ros/render_ros.hpp"

int main(int argc, char** argv) {
  calipso::render::keepFreedMemory();
  return calipso::runNode<calipso::render::RenderNode>(argc, argv, "render");
}

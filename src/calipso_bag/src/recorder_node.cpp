#include <iostream>

#include "calipso_ros/mode.hpp"
#include "calipso_ros/node_main.hpp"
#include "calipso_scene/memory.hpp"
#include "ros/guarded_main.hpp"
#include "ros/recorder.hpp"

namespace {

calipso::bag::Recorder::Params loadParams(const ros::NodeHandle& pnh) {
  calipso::bag::Recorder::Params params;
  params.output = calipso::pathParam(pnh, "output");
  for (const char* name : {"input", "edits"})
    params.inputs.push_back(calipso::optionalPathParam(pnh, name));
  params.mode = calipso::modeParam(pnh);
  params.flow = calipso::optionalParam(pnh, "flow", params.flow);
  params.late_timeout_sec =
      calipso::optionalParam(pnh, "late_timeout_sec", params.late_timeout_sec);
  return params;
}

}  // namespace

int main(int argc, char** argv) {
  calipso::keepFreedMemory();
  ros::init(argc, argv, "recorder");
  ros::NodeHandle nh;
  const ros::NodeHandle pnh("~");
  return calipso::bag::runGuarded("recorder", [&] {
    calipso::bag::Recorder recorder(nh, loadParams(pnh));
    recorder.run();
    std::cout << calipso::bag::format(recorder.summary()) << std::endl;
  });
}

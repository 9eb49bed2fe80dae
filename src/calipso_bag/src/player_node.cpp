#include "calipso_ros/node_main.hpp"
#include "calipso_scene/memory.hpp"
#include "ros/guarded_main.hpp"
#include "ros/player.hpp"

namespace {

calipso::bag::Player::Params loadParams(const ros::NodeHandle& pnh) {
  calipso::bag::Player::Params params;
  const auto read = [&](const std::string& name, auto& value) {
    value = calipso::optionalParam(pnh, name, value);
  };
  params.clip.path = calipso::pathParam(pnh, "bag");
  params.scene = calipso::pathParam(pnh, "scene");
  read("image_topic", params.clip.image_topic);
  read("camera_info_topic", params.clip.camera_info_topic);
  params.edits = calipso::optionalPathParam(pnh, "edits");
  read("poses", params.poses);
  read("nodes", params.nodes);
  read("estimate_wind", params.estimate_wind);
  read("in_flight", params.in_flight);
  read("connect_timeout_sec", params.connect_timeout_sec);
  read("prepare_timeout_sec", params.prepare_timeout_sec);
  read("frame_timeout_sec", params.frame_timeout_sec);
  return params;
}

}  // namespace

int main(int argc, char** argv) {
  calipso::keepFreedMemory();
  ros::init(argc, argv, "player");
  ros::NodeHandle nh;
  const ros::NodeHandle pnh("~");
  return calipso::bag::runGuarded("player", [&] {
    calipso::bag::Player player(nh, loadParams(pnh));
    player.run();
    ros::spin();  // what was latched stays there for those who look on
  });
}

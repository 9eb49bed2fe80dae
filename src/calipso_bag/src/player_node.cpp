#include "calipso_ros/node_main.hpp"
#include "ros/guarded_main.hpp"
#include "ros/player.hpp"

namespace {

calipso::bag::Player::Params loadParams(const ros::NodeHandle& pnh) {
  calipso::bag::Player::Params params;
  params.clip.path = calipso::requiredParam<std::string>(pnh, "bag");
  params.scene = calipso::requiredParam<std::string>(pnh, "scene");
  pnh.getParam("image_topic", params.clip.image_topic);
  pnh.getParam("camera_info_topic", params.clip.camera_info_topic);
  pnh.getParam("edits", params.edits);
  pnh.getParam("poses", params.poses);
  pnh.getParam("nodes", params.nodes);
  pnh.getParam("estimate_wind", params.estimate_wind);
  pnh.getParam("in_flight", params.in_flight);
  pnh.getParam("connect_timeout_sec", params.connect_timeout_sec);
  pnh.getParam("prepare_timeout_sec", params.prepare_timeout_sec);
  pnh.getParam("frame_timeout_sec", params.frame_timeout_sec);
  return params;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "player");
  ros::NodeHandle nh;
  const ros::NodeHandle pnh("~");
  return calipso::bag::runGuarded("player", [&] {
    calipso::bag::Player player(nh, loadParams(pnh));
    player.run();
    ros::spin();  // what was latched stays there for those who look on
  });
}

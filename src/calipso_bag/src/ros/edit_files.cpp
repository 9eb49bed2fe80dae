#include "edit_files.hpp"

#include <calipso_msgs/EditReport.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <stdexcept>

#include "calipso_ros/conversions.hpp"
#include "calipso_scene/edit.hpp"
#include "open_bag.hpp"

namespace calipso::bag {
namespace {

std::vector<std::string> objectNames(const Scene& scene) {
  std::vector<std::string> names;
  for (const SceneObject& object : scene.objects) names.push_back(object.name);
  return names;
}

bool endsWith(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

std::vector<calipso_msgs::Edit> readYaml(const std::string& path, const Scene& scene,
                                         const ros::Time& first_stamp) {
  std::vector<calipso_msgs::Edit> edits;
  for (const Edit& edit : loadEdits(path, objectNames(scene))) {
    edits.push_back(toMsg(edit, first_stamp));
  }
  return edits;
}

// An edit that was sent for "the next frame" is repeated at the frame it took effect with.
std::vector<calipso_msgs::Edit> readBag(const std::string& path, const Scene& scene,
                                        const ros::Time& first_stamp) {
  std::vector<calipso_msgs::Edit> edits;
  std::vector<std::string> names = objectNames(scene);
  rosbag::Bag bag;
  openForReading(bag, path);
  rosbag::View view(bag, rosbag::TypeQuery("calipso_msgs/EditReport"));
  for (const rosbag::MessageInstance& message : view) {
    const auto report = message.instantiate<calipso_msgs::EditReport>();
    if (!report->accepted) continue;
    edits.push_back(report->edit);
    if (edits.back().header.stamp.isZero()) edits.back().header.stamp = report->header.stamp;
    const Edit edit = fromMsg(edits.back(), first_stamp);
    validate(edit, names);
    if (!edit.new_name.empty()) names.push_back(edit.new_name);
  }
  return edits;
}

}  // namespace

std::vector<calipso_msgs::Edit> readEdits(const std::string& path, const Scene& scene,
                                          const ros::Time& first_stamp) {
  if (path.empty()) return {};
  if (!endsWith(path, ".bag")) return readYaml(path, scene, first_stamp);
  try {
    return readBag(path, scene, first_stamp);
  } catch (const rosbag::BagException& e) {
    throw damaged(path, e);
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument(path + ": " + e.what());
  }
}

}  // namespace calipso::bag

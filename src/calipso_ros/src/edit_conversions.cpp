#include <algorithm>
#include <cmath>
#include <limits>

#include "calipso_ros/conversions.hpp"

namespace calipso {

namespace {

calipso_msgs::Region toMsg(const Region& region) {
  calipso_msgs::Region msg;
  msg.kind = toString(region.kind);
  msg.u = region.pixel.x();
  msg.v = region.pixel.y();
  msg.point = toPointMsg(region.point);
  msg.radius = region.radius;
  msg.box_min = toPointMsg(region.box_min);
  msg.box_max = toPointMsg(region.box_max);
  return msg;
}

Region fromMsg(const calipso_msgs::Region& msg) {
  Region region;
  region.kind = regionKindFromString(msg.kind);
  region.pixel = {msg.u, msg.v};
  region.point = calipso::fromMsg(msg.point);
  region.radius = msg.radius;
  region.box_min = calipso::fromMsg(msg.box_min);
  region.box_max = calipso::fromMsg(msg.box_max);
  return region;
}

// A message cannot leave a number out: there 0 stands for "unchanged", and the smallest positive
// number for a zero that is meant.
double toField(double value) {
  if (std::isnan(value)) return 0.0;
  return value == 0.0 ? std::numeric_limits<double>::min() : value;
}

double fromField(double value) { return value == 0.0 ? kUnchanged : value; }

// Left out, a factor is 1. (Weightlessness, gravity times 0, is meant.)
double factorOf(const calipso_msgs::Edit& msg, EditKind kind) {
  return msg.factor == 0.0 && kind != EditKind::kGravity ? 1.0 : msg.factor;
}

// A message that leaves the colour out holds zeros.
Eigen::Vector3d colorOf(const std_msgs::ColorRGBA& c) {
  if (c.r == 0.0f && c.g == 0.0f && c.b == 0.0f) return Eigen::Vector3d::Constant(kUnchanged);
  return {c.r, c.g, c.b};
}

// What black means must not read as "left out".
std_msgs::ColorRGBA toColorMsg(const Eigen::Vector3d& color) {
  std_msgs::ColorRGBA msg;
  if (!color.allFinite()) return msg;
  msg.r = static_cast<float>(color.x());
  msg.g = static_cast<float>(color.y());
  msg.b = static_cast<float>(color.z());
  if (color.isZero()) msg.r = std::numeric_limits<float>::min();
  msg.a = 1.0f;
  return msg;
}

std::string valueOf(const Edit& edit) {
  if (edit.kind == EditKind::kObjectKind) return toString(edit.object_kind);
  if (edit.kind == EditKind::kContact) return edit.meet ? "include" : "exclude";
  return edit.new_name;
}

void setValue(const calipso_msgs::Edit& msg, Edit& edit) {
  if (edit.kind == EditKind::kObjectKind) edit.object_kind = objectKindFromString(msg.value);
  if (edit.kind == EditKind::kContact) edit.meet = meetFromString(msg.value);
  if (edit.kind == EditKind::kDuplicate || edit.kind == EditKind::kInsert)
    edit.new_name = msg.value;
}

// A message that leaves the quaternion out holds zeros.
Eigen::Quaterniond rotationOf(const geometry_msgs::Quaternion& q) {
  if (q.x == 0.0 && q.y == 0.0 && q.z == 0.0 && q.w == 0.0) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized();
}

void setVectors(const Edit& edit, calipso_msgs::Edit& msg) {
  msg.vector = toVectorMsg(edit.vector);
  msg.angular = toVectorMsg(edit.angular);
  msg.translation = toVectorMsg(edit.translation);
  msg.rotation.x = edit.rotation.x();
  msg.rotation.y = edit.rotation.y();
  msg.rotation.z = edit.rotation.z();
  msg.rotation.w = edit.rotation.w();
}

}  // namespace

calipso_msgs::Edit toMsg(const Edit& edit, const ros::Time& first_stamp) {
  calipso_msgs::Edit msg;
  if (edit.time >= 0.0) msg.header.stamp = first_stamp + ros::Duration(edit.time);
  msg.object = edit.object;
  msg.kind = toString(edit.kind);
  msg.mode = toString(edit.mode);
  msg.region = toMsg(edit.region);
  setVectors(edit, msg);
  msg.scale = edit.scale;
  msg.factor = edit.factor;
  msg.ramp = edit.ramp;
  msg.duration = edit.duration;
  msg.youngs_modulus = toField(edit.youngs_modulus);
  msg.poissons_ratio = toField(edit.poissons_ratio);
  msg.density = toField(edit.density);
  msg.damping = toField(edit.damping);
  msg.value = valueOf(edit);
  msg.model = edit.model_path;
  msg.other = edit.other;
  msg.friction = toField(edit.friction);
  msg.restitution = toField(edit.restitution);
  msg.pressure = edit.pressure;
  msg.color = toColorMsg(edit.color);
  msg.specular = toField(edit.specular);
  msg.roughness = toField(edit.roughness);
  msg.after = edit.after;
  msg.collision = static_cast<std::uint32_t>(edit.collision);
  return msg;
}

Edit fromMsg(const calipso_msgs::Edit& msg, const ros::Time& first_stamp) {
  Edit edit;
  edit.time = msg.header.stamp.isZero() ? -1.0 : (msg.header.stamp - first_stamp).toSec();
  edit.object = msg.object;
  edit.kind = editKindFromString(msg.kind);
  edit.mode = editModeFromString(msg.mode, edit.kind);
  edit.region = fromMsg(msg.region);
  edit.vector = fromMsg(msg.vector);
  edit.angular = fromMsg(msg.angular);
  edit.translation = fromMsg(msg.translation);
  edit.rotation = rotationOf(msg.rotation);
  edit.scale = msg.scale == 0.0 ? 1.0 : msg.scale;
  edit.factor = factorOf(msg, edit.kind);
  edit.ramp = msg.ramp;
  edit.duration = msg.duration;
  edit.youngs_modulus = fromField(msg.youngs_modulus);
  edit.poissons_ratio = fromField(msg.poissons_ratio);
  edit.density = fromField(msg.density);
  edit.damping = fromField(msg.damping);
  setValue(msg, edit);
  edit.model_path = msg.model;
  edit.other = msg.other;
  edit.friction = fromField(msg.friction);
  edit.restitution = fromField(msg.restitution);
  edit.pressure = msg.pressure;
  edit.color = colorOf(msg.color);
  edit.specular = fromField(msg.specular);
  edit.roughness = fromField(msg.roughness);
  edit.after = msg.after;
  edit.collision = std::max(1, static_cast<int>(msg.collision));
  return edit;
}

}  // namespace calipso

#include "ros/align_conversions.hpp"

#include <cmath>

#include "calipso_ros/conversions.hpp"

namespace calipso::align {
namespace {

// Hue turned by the golden angle from object to object, so that neighbours differ.
std_msgs::ColorRGBA colourOf(int index) {
  constexpr double kGoldenAngle = 2.399963;
  std_msgs::ColorRGBA colour;
  colour.r = static_cast<float>(0.5 + 0.4 * std::cos(kGoldenAngle * index));
  colour.g = static_cast<float>(0.5 + 0.4 * std::cos(kGoldenAngle * index - 2.094395));
  colour.b = static_cast<float>(0.5 + 0.4 * std::cos(kGoldenAngle * index + 2.094395));
  colour.a = 0.7f;
  return colour;
}

std_msgs::ColorRGBA red() {
  std_msgs::ColorRGBA colour;
  colour.r = 1.0f;
  colour.a = 0.7f;
  return colour;
}

}  // namespace

calipso_msgs::AlignedModel toMsg(const SceneObject& object, const AlignmentResult& result) {
  calipso_msgs::AlignedModel msg;
  msg.object = object.name;
  msg.index = static_cast<std::uint8_t>(object.index);
  msg.world_from_object.pose = calipso::toMsg(result.world_from_object);
  for (int i = 0; i < 36; ++i)
    msg.world_from_object.covariance[i] = result.covariance(i / 6, i % 6);
  msg.mesh = calipso::toMsg(result.mesh);
  msg.cad = calipso::toMsg(result.rest);
  msg.contour_mean_px = static_cast<float>(result.contour_mean_px);
  msg.contour_p95_px = static_cast<float>(result.contour_p95_px);
  for (const std::vector<float>& loop : result.residual_px) {
    msg.residual_px.insert(msg.residual_px.end(), loop.begin(), loop.end());
  }
  msg.trusted = result.trusted;
  msg.reason = result.reason;
  msg.seconds = static_cast<float>(1e-3 * totalMs(result));
  return msg;
}

visualization_msgs::Marker toMarker(const std_msgs::Header& header,
                                    const calipso_msgs::AlignedModel& model) {
  visualization_msgs::Marker marker;
  marker.header = header;
  marker.ns = "aligned";
  marker.id = model.index;
  marker.type = visualization_msgs::Marker::TRIANGLE_LIST;
  marker.pose = model.world_from_object.pose;
  marker.scale.x = marker.scale.y = marker.scale.z = 1.0;
  marker.color = model.trusted ? colourOf(model.index) : red();
  for (const std::uint32_t v : model.mesh.triangles) {
    geometry_msgs::Point point;
    point.x = model.mesh.vertices[3 * v];
    point.y = model.mesh.vertices[3 * v + 1];
    point.z = model.mesh.vertices[3 * v + 2];
    marker.points.push_back(point);
  }
  return marker;
}

}  // namespace calipso::align

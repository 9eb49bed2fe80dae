#include "world_markers.hpp"

#include <algorithm>
#include <cmath>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"

namespace calipso::fem {
namespace {

using visualization_msgs::Marker;

std_msgs::ColorRGBA colour(double r, double g, double b, double a = 1.0) {
  std_msgs::ColorRGBA c;
  c.r = static_cast<float>(r);
  c.g = static_cast<float>(g);
  c.b = static_cast<float>(b);
  c.a = static_cast<float>(a);
  return c;
}

// Blue over green to red for s in 0..1.
std_msgs::ColorRGBA heat(double s) {
  const double t = std::min(1.0, std::max(0.0, s));
  return colour(std::max(0.0, 2.0 * t - 1.0), 1.0 - std::abs(2.0 * t - 1.0),
                std::max(0.0, 1.0 - 2.0 * t));
}

Marker markerOf(const std::string& ns, int id, int type, const ros::Time& stamp) {
  Marker m;
  m.header.stamp = stamp;
  m.header.frame_id = topics::kWorldFrame;
  m.ns = ns;
  m.id = id;
  m.type = type;
  m.action = Marker::ADD;
  m.pose.orientation.w = 1.0;
  m.scale.x = m.scale.y = m.scale.z = 1.0;
  m.color = colour(0.8, 0.8, 0.8);
  return m;
}

// What colours the surface, scaled to 0..1 by its largest value.
Eigen::VectorXd surfaceValue(const ObjectSnapshot& s, const WorldObject& object,
                             const std::string& by) {
  Eigen::VectorXd value = s.von_mises;
  if (by == "displacement") {
    value.resize(s.vertices.rows());
    for (int i = 0; i < value.size(); ++i)
      value[i] =
          (s.vertices.row(i).transpose() - object.world_from_object * object.mesh.vertex(i)).norm();
  }
  const double largest = value.size() ? value.maxCoeff() : 0.0;
  return largest > 0.0 ? Eigen::VectorXd(value / largest) : value;
}

Marker surfaceMarker(const ObjectSnapshot& s, const WorldObject& object, const MarkerStyle& style,
                     const ros::Time& stamp) {
  Marker m = markerOf("surface", s.index, Marker::TRIANGLE_LIST, stamp);
  if (s.removed) {
    m.action = Marker::DELETE;
    return m;
  }
  const Eigen::VectorXd value = surfaceValue(s, object, style.colour_by);
  for (int f = 0; f < object.mesh.triangleCount(); ++f)
    for (int k = 0; k < 3; ++k) {
      const int v = object.mesh.triangles(f, k);
      const Eigen::Vector3d p = s.vertices.rows() ? Eigen::Vector3d(s.vertices.row(v).transpose())
                                                  : s.world_from_object * object.mesh.vertex(v);
      m.points.push_back(toPointMsg(p));
      m.colors.push_back(value.size() ? heat(value[v]) : m.color);
    }
  return m;
}

Marker arrow(const std::string& ns, int id, const Eigen::Vector3d& from, const Eigen::Vector3d& by,
             const std_msgs::ColorRGBA& c, const ros::Time& stamp) {
  Marker m = markerOf(ns, id, Marker::ARROW, stamp);
  m.points = {toPointMsg(from), toPointMsg(from + by)};
  m.scale.x = 0.06 * by.norm();  // shaft
  m.scale.y = 0.12 * by.norm();  // head
  m.scale.z = 0.0;
  m.color = c;
  return m;
}

// Removes what an earlier message drew in a namespace whose number of markers changes.
Marker clear(const std::string& ns, const ros::Time& stamp) {
  Marker m = markerOf(ns, 0, Marker::CUBE, stamp);
  m.action = Marker::DELETEALL;
  return m;
}

double sizeOf(const World& world) {
  double size = 0.0;
  for (const WorldObject& object : world.scene().objects)
    size = std::max(size, boundingDiagonal(object.mesh));
  return size > 0.0 ? size : 1.0;
}

void addDrawings(const World& world, const MarkerStyle& style, const ros::Time& stamp,
                 std::vector<Marker>& markers) {
  const double size = sizeOf(world);
  int id = 0;
  for (const World::Drawing& drawing : world.drawings()) {
    Marker grid = markerOf("volume_grid", ++id, Marker::LINE_LIST, stamp);
    grid.scale.x = 0.001 * size;
    grid.color = colour(0.2, 0.6, 1.0, 0.5);
    for (const auto& p : drawing.edges) grid.points.push_back(toPointMsg(p));
    Marker fixed = markerOf("fixed_nodes", id, Marker::SPHERE_LIST, stamp);
    fixed.scale.x = fixed.scale.y = fixed.scale.z = 0.02 * size;
    fixed.color = colour(1.0, 0.8, 0.0);
    for (const auto& p : drawing.fixed) fixed.points.push_back(toPointMsg(p));
    for (Marker* m : {&grid, &fixed})
      if (!m->points.empty()) markers.push_back(*m);
    int arrows = 0;
    for (const auto& [point, force] : drawing.forces)
      markers.push_back(arrow("forces", 100 * id + arrows++, point, style.force_scale * force,
                              colour(1.0, 0.1, 0.6), stamp));
  }
}

void addContacts(const WorldState& state, const MarkerStyle& style, const ros::Time& stamp,
                 std::vector<Marker>& markers) {
  int id = 0;
  for (const ContactPoint& c : state.contacts)
    markers.push_back(arrow("contacts", ++id, c.position, style.force_scale * c.force,
                            c.first_touch ? colour(1, 0, 0) : colour(0.1, 0.9, 0.3), stamp));
}

void addSupports(const World& world, const ros::Time& stamp, std::vector<Marker>& markers) {
  const double half = 5.0 * sizeOf(world);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const WorldObject& object : world.scene().objects)
    middle +=
        object.world_from_object.translation() / static_cast<double>(world.scene().objects.size());
  int id = 0;
  for (const SupportPlane& plane : world.scene().planes) {
    Marker m = markerOf("support", ++id, Marker::CUBE, stamp);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), plane.normal)
                        .toRotationMatrix();
    pose.translation() = middle - (plane.normal.dot(middle) - plane.offset) * plane.normal;
    m.pose = calipso::toMsg(pose);
    m.scale.x = m.scale.y = 2.0 * half;
    m.scale.z = 1e-3 * half;
    m.color = colour(0.6, 0.6, 0.6, 0.3);
    markers.push_back(m);
  }
}

}  // namespace

visualization_msgs::MarkerArray toMarkers(const World& world, const MarkerStyle& style,
                                          const ros::Time& stamp) {
  visualization_msgs::MarkerArray array;
  const WorldState state = world.state();
  for (const char* ns : {"volume_grid", "fixed_nodes", "forces", "contacts"})
    array.markers.push_back(clear(ns, stamp));
  for (size_t k = 0; k < state.objects.size(); ++k)
    array.markers.push_back(
        surfaceMarker(state.objects[k], world.scene().objects[k], style, stamp));
  addDrawings(world, style, stamp, array.markers);
  addContacts(state, style, stamp, array.markers);
  addSupports(world, stamp, array.markers);
  return array;
}

}  // namespace calipso::fem

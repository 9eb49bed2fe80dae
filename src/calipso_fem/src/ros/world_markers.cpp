#include "world_markers.hpp"

#include <algorithm>
#include <cmath>
#include <map>

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

// Without values it has one colour, which rviz shades.
Marker surfaceMarker(const ObjectSnapshot& s, const WorldObject& object,
                     const std::string& colour_by, const ros::Time& stamp) {
  Marker m = markerOf("surface", s.index, Marker::TRIANGLE_LIST, stamp);
  const Eigen::VectorXd value = surfaceValue(s, object, colour_by);
  for (int f = 0; f < object.mesh.triangleCount(); ++f)
    for (int k = 0; k < 3; ++k) {
      const int v = object.mesh.triangles(f, k);
      const Eigen::Vector3d p = s.vertices.rows() ? Eigen::Vector3d(s.vertices.row(v).transpose())
                                                  : s.world_from_object * object.mesh.vertex(v);
      m.points.push_back(toPointMsg(p));
      if (value.size()) m.colors.push_back(heat(value[v]));
    }
  return m;
}

// What drawings of one object are measured by: scenes are of centimetres or of hundreds of metres.
struct Measure {
  double size = 0.0;    // m
  double weight = 0.0;  // N, on earth; 0: nothing moves it
};

std::map<std::string, Measure> measuresOf(const World& world,
                                          const std::vector<World::Drawing>& drawings) {
  constexpr double kEarth = 9.81;  // m/s^2
  std::map<std::string, Measure> measures;
  for (const WorldObject& object : world.scene().objects)
    measures[object.name].size = boundingDiagonal(object.mesh);
  for (const World::Drawing& drawing : drawings)
    if (std::isfinite(drawing.mass)) measures[drawing.object].weight = kEarth * drawing.mass;
  return measures;
}

// The lighter of two that touch, as it is the one that a force between them moves.
Measure lighterOf(const Measure& a, const Measure& b) {
  if (a.weight <= 0.0 || b.weight <= 0.0) return b.weight > 0.0 ? b : a;
  return a.weight < b.weight ? a : b;
}

// A force of the object's weight is half as long as the object, and none is longer than it. Without
// a length there is none: rviz takes it for an error.
void addArrow(const std::string& ns, int id, const Eigen::Vector3d& from,
              const Eigen::Vector3d& force, const Measure& on, const std_msgs::ColorRGBA& c,
              const ros::Time& stamp, std::vector<Marker>& markers) {
  const double size = force.norm(), length = on.size * size / (size + on.weight);
  if (!(length > 1e-3 * on.size)) return;
  Marker m = markerOf(ns, id, Marker::ARROW, stamp);
  m.points = {toPointMsg(from), toPointMsg(from + length / size * force)};
  m.scale.x = 0.06 * length;  // shaft
  m.scale.y = 0.12 * length;  // head
  m.scale.z = 0.0;
  m.color = c;
  markers.push_back(m);
}

// Takes away all that was drawn before, the models as aligned included: rviz minds no namespace.
Marker clearAll(const ros::Time& stamp) {
  Marker m = markerOf("surface", 0, Marker::CUBE, stamp);
  m.action = Marker::DELETEALL;
  return m;
}

void addGrid(const World::Drawing& drawing, double size, int id, const ros::Time& stamp,
             std::vector<Marker>& markers) {
  Marker grid = markerOf("volume_grid", id, Marker::LINE_LIST, stamp);
  grid.scale.x = 0.001 * size;
  grid.color = colour(0.2, 0.6, 1.0, 0.5);
  for (const auto& p : drawing.edges) grid.points.push_back(toPointMsg(p));
  Marker fixed = markerOf("fixed_nodes", id, Marker::SPHERE_LIST, stamp);
  fixed.scale.x = fixed.scale.y = fixed.scale.z = 0.01 * size;
  fixed.color = colour(1.0, 0.8, 0.0);
  for (const auto& p : drawing.fixed) fixed.points.push_back(toPointMsg(p));
  for (Marker* m : {&grid, &fixed})
    if (!m->points.empty()) markers.push_back(*m);
}

void addDrawings(const World& world, const WorldState& state, const ros::Time& stamp,
                 std::vector<Marker>& markers) {
  const std::vector<World::Drawing> drawings = world.drawings();
  const std::map<std::string, Measure> measures = measuresOf(world, drawings);
  const auto measureOf = [&](const std::string& object) {
    const auto found = measures.find(object);
    return found == measures.end() ? Measure{} : found->second;  // a support has none
  };
  int id = 0, arrows = 0, contacts = 0;
  for (const World::Drawing& drawing : drawings) {
    const Measure measure = measureOf(drawing.object);
    addGrid(drawing, measure.size, ++id, stamp, markers);
    for (const auto& [point, force] : drawing.forces)
      addArrow("forces", ++arrows, point, force, measure, colour(1.0, 0.1, 0.6), stamp, markers);
  }
  for (const ContactPoint& c : state.contacts)
    addArrow("contacts", ++contacts, c.position, c.force, lighterOf(measureOf(c.a), measureOf(c.b)),
             c.first_touch ? colour(1, 0, 0) : colour(0.1, 0.9, 0.3), stamp, markers);
}

// A box around all objects.
Eigen::AlignedBox3d boundsOf(const World& world) {
  Eigen::AlignedBox3d bounds;
  for (const WorldObject& object : world.scene().objects)
    for (int i = 0; i < object.mesh.vertexCount(); ++i)
      bounds.extend(object.world_from_object * object.mesh.vertex(i));
  return bounds;
}

void addSupports(const World& world, const ros::Time& stamp, std::vector<Marker>& markers) {
  const Eigen::AlignedBox3d bounds = boundsOf(world);
  if (bounds.isEmpty()) return;
  const Eigen::Vector3d middle = bounds.center();
  const double width = 4.0 * bounds.diagonal().norm();
  int id = 0;
  for (const SupportPlane& plane : world.scene().planes) {
    Marker m = markerOf("support", ++id, Marker::CUBE, stamp);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), plane.normal)
                        .toRotationMatrix();
    pose.translation() = middle - (plane.normal.dot(middle) - plane.offset) * plane.normal;
    m.pose = calipso::toMsg(pose);
    m.scale.x = m.scale.y = width;
    m.scale.z = 1e-3 * width;
    m.color = colour(0.6, 0.6, 0.6, 0.3);
    markers.push_back(m);
  }
}

}  // namespace

visualization_msgs::MarkerArray toMarkers(const World& world, const std::string& colour_by,
                                          const ros::Time& stamp) {
  visualization_msgs::MarkerArray array;
  const WorldState state = world.state();
  array.markers.push_back(clearAll(stamp));
  for (size_t k = 0; k < state.objects.size(); ++k)
    if (!state.objects[k].removed)
      array.markers.push_back(
          surfaceMarker(state.objects[k], world.scene().objects[k], colour_by, stamp));
  addDrawings(world, state, stamp, array.markers);
  addSupports(world, stamp, array.markers);
  return array;
}

}  // namespace calipso::fem

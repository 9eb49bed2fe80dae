#include "world_conversions.hpp"

#include <stdexcept>
#include <string>

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"

namespace calipso::fem {
namespace {

std_msgs::Header headerAt(const ros::Time& stamp) {
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = topics::kWorldFrame;
  return header;
}

calipso_msgs::Look toMsg(const Look& look) {
  calipso_msgs::Look m;
  for (int i = 0; i < 3; ++i) m.color[i] = look.color[i];
  m.color_is_absolute = look.absolute;
  m.specular = look.specular;
  m.roughness = look.roughness;
  return m;
}

calipso_msgs::ObjectState toMsg(const ObjectSnapshot& s) {
  calipso_msgs::ObjectState m;
  m.object = s.name;
  m.index = static_cast<std::uint8_t>(s.index);
  m.kind = toString(s.kind);
  m.edited = s.edited;
  m.removed = s.removed;
  m.sleeping = s.sleeping;
  m.pose = calipso::toMsg(s.world_from_object);
  if (s.observed) m.observed_pose.push_back(calipso::toMsg(*s.observed));
  m.vertices.assign(s.vertices.data(), s.vertices.data() + s.vertices.size());
  m.triangles.assign(s.triangles.data(), s.triangles.data() + s.triangles.size());
  m.von_mises.assign(s.von_mises.data(), s.von_mises.data() + s.von_mises.size());
  m.kinetic_energy = s.kinetic_energy;
  m.elastic_energy = s.elastic_energy;
  m.source = s.source;
  if (s.look.changes()) m.look.push_back(toMsg(s.look));
  return m;
}

calipso_msgs::Contact toMsg(const ContactPoint& c) {
  calipso_msgs::Contact m;
  m.object_a = c.a;
  m.object_b = c.b;
  m.position = toPointMsg(c.position);
  m.normal = toVectorMsg(c.normal);
  m.force = toVectorMsg(c.force);
  m.depth = c.depth;
  m.first_touch = c.first_touch;
  return m;
}

calipso_msgs::ObjectPlan toMsg(const PlanEntry& e) {
  calipso_msgs::ObjectPlan m;
  m.object = e.object;
  m.kind = toString(e.kind);
  m.reason = e.reason;
  m.nodes = static_cast<std::uint32_t>(e.nodes);
  m.elements = static_cast<std::uint32_t>(e.elements);
  m.element = e.element;
  m.material = e.material_model;
  m.solver = e.solver;
  m.cell_size = e.cell_size;
  m.time_step = e.time_step;
  m.youngs_modulus = e.material.youngs_modulus;
  m.poissons_ratio = e.material.poissons_ratio;
  m.density = e.material.density;
  m.mass = e.mass;
  m.estimated_ms_per_frame = e.ms_per_frame;
  return m;
}

Eigen::VectorXd toVector(const std::vector<float>& numbers) {
  return Eigen::Map<const Eigen::VectorXf>(numbers.data(), numbers.size()).cast<double>();
}

}  // namespace

WorldScene toWorldScene(const Scene& scene, const calipso_msgs::AlignedModels& models) {
  WorldScene w;
  w.camera = scene.camera;
  w.directory = scene.directory;
  w.gravity = scene.gravity;
  w.planes = scene.planes;
  for (const std::string& path : scene.support_meshes)
    w.support_meshes.push_back({path.substr(path.find_last_of('/') + 1), loadMesh(path)});
  for (const calipso_msgs::AlignedModel& model : models.models) {
    WorldObject object;
    object.name = model.object;
    object.index = model.index;
    object.mesh = calipso::fromMsg(model.mesh);
    object.world_from_object = calipso::fromMsg(model.world_from_object.pose);
    object.attachments = scene.object(model.object).attachments;
    w.objects.push_back(std::move(object));
  }
  return w;
}

ObservedMotion fromMsg(const calipso_msgs::ObjectDynamics& d, double time) {
  ObservedMotion m;
  m.time = time;
  m.moving = d.moving;
  m.world_from_object = calipso::fromMsg(d.world_from_object);
  m.centroid = calipso::fromMsg(d.centroid);
  m.linear = calipso::fromMsg(d.twist.twist.linear);
  m.angular = calipso::fromMsg(d.twist.twist.angular);
  m.acceleration = calipso::fromMsg(d.acceleration);
  m.mode_amplitudes = toVector(d.mode_amplitudes);
  m.mode_velocities = toVector(d.mode_velocities);
  return m;
}

ObservedWind fromMsg(const calipso_msgs::Wind& wind, const ros::Time& first_stamp) {
  ObservedWind w;
  w.time = (wind.stamp - first_stamp).toSec();
  w.velocity = calipso::fromMsg(wind.velocity);
  w.covariance =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(wind.covariance.data());
  return w;
}

Eigen::MatrixXd shapesOf(const std::vector<calipso_msgs::DeformationMode>& modes) {
  const size_t rows = modes.empty() ? 0 : modes.front().displacements.size();
  Eigen::MatrixXd shapes(rows, modes.size());
  for (size_t m = 0; m < modes.size(); ++m) {
    if (modes[m].displacements.size() != rows)
      throw std::invalid_argument("mode " + std::to_string(m) + " has " +
                                  std::to_string(modes[m].displacements.size()) +
                                  " numbers, the first one " + std::to_string(rows));
    shapes.col(m) = toVector(modes[m].displacements);
  }
  return shapes;
}

calipso_msgs::SimulationState toMsg(const WorldState& state, const ros::Time& stamp) {
  calipso_msgs::SimulationState m;
  m.header = headerAt(stamp);
  for (const ObjectSnapshot& object : state.objects) m.objects.push_back(toMsg(object));
  for (const ContactPoint& contact : state.contacts) m.contacts.push_back(toMsg(contact));
  m.sun_direction = toVectorMsg(state.sun.direction);
  m.sun_factor = state.sun.factor;
  m.step_ms = static_cast<float>(state.step_ms);
  m.substeps = static_cast<std::uint32_t>(state.substeps);
  return m;
}

calipso_msgs::Plan toMsg(const std::vector<PlanEntry>& plan, const ros::Time& stamp) {
  calipso_msgs::Plan m;
  m.header = headerAt(stamp);
  for (const PlanEntry& entry : plan) m.objects.push_back(toMsg(entry));
  return m;
}

calipso_msgs::EditReport toMsg(const EditOutcome& outcome, const ros::Time& stamp,
                               const ros::Time& first_stamp) {
  calipso_msgs::EditReport m;
  m.header = headerAt(stamp);
  m.edit = calipso::toMsg(outcome.edit, first_stamp);
  m.accepted = outcome.accepted;
  m.message = outcome.message;
  return m;
}

}  // namespace calipso::fem

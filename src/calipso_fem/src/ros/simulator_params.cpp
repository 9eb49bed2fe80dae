#include "simulator_params.hpp"

#include <stdexcept>

#include "calipso_ros/node_main.hpp"

namespace calipso::fem {
namespace {

double number(XmlRpc::XmlRpcValue& value, const std::string& name) {
  if (value.getType() == XmlRpc::XmlRpcValue::TypeInt) return static_cast<int>(value);
  if (value.getType() == XmlRpc::XmlRpcValue::TypeDouble) return static_cast<double>(value);
  throw std::invalid_argument("parameter " + name + " is no number; give one in SI units");
}

// One object's settings; `where` is the parameter's name, for errors.
ObjectSettings readSettings(XmlRpc::XmlRpcValue& map, ObjectSettings settings,
                            const std::string& where) {
  if (map.getType() != XmlRpc::XmlRpcValue::TypeStruct)
    throw std::invalid_argument("parameter " + where +
                                " is no map; give keys such as youngs_modulus");
  for (auto& [key, value] : map) {
    const std::string name = where + "/" + key;
    if (key == "kind") {
      if (value.getType() != XmlRpc::XmlRpcValue::TypeString)
        throw std::invalid_argument("parameter " + name + " is no text");
      settings.kind = objectKindFromString(static_cast<std::string>(value));
    } else if (key == "self_contact") {
      if (value.getType() != XmlRpc::XmlRpcValue::TypeBoolean)
        throw std::invalid_argument("parameter " + name + " is neither true nor false");
      settings.self_contact = static_cast<bool>(value);
    } else if (key == "youngs_modulus")
      settings.youngs_modulus = number(value, name);
    else if (key == "poissons_ratio")
      settings.poissons_ratio = number(value, name);
    else if (key == "density")
      settings.density = number(value, name);
    else if (key == "damping")
      settings.damping = number(value, name);
    else if (key == "cell_size")
      settings.cell_size = number(value, name);
    else if (key == "friction")
      settings.surface.friction = number(value, name);
    else if (key == "restitution")
      settings.surface.restitution = number(value, name);
    else if (key == "rolling_friction")
      settings.surface.rolling_friction = number(value, name);
    else
      throw std::invalid_argument("parameter " + name + " is unknown; see config/simulator.yaml");
  }
  return settings;
}

void readObjects(const ros::NodeHandle& pnh, WorldParams& world) {
  XmlRpc::XmlRpcValue value;
  if (pnh.getParam("defaults", value)) world.defaults = readSettings(value, {}, "defaults");
  if (pnh.getParam("support", value)) world.support = readSettings(value, {}, "support").surface;
  if (!pnh.getParam("objects", value)) return;
  if (value.getType() != XmlRpc::XmlRpcValue::TypeStruct)
    throw std::invalid_argument("parameter objects is no map of object names");
  for (auto& [name, settings] : value)
    world.objects[name] = readSettings(settings, world.defaults, "objects/" + name);
}

constexpr int kMostLiveFrames = 3;  // stepped at once: so many late frames are caught up with

}  // namespace

SimulatorParams loadSimulatorParams(const ros::NodeHandle& pnh) {
  SimulatorParams p;
  p.scene_directory = pathParam(pnh, "scene");
  p.mode = modeParam(pnh);
  p.colour_by = optionalParam(pnh, "colour_by", p.colour_by);
  if (p.colour_by != "von_mises" && p.colour_by != "displacement")
    throw std::invalid_argument("parameter colour_by = '" + p.colour_by +
                                "'; must be von_mises or displacement");
  WorldParams& w = p.world;
  w.pixel_error = optionalParam(pnh, "pixel_error", w.pixel_error);
  w.max_nodes = optionalParam(pnh, "max_nodes", w.max_nodes);
  w.max_substeps = optionalParam(pnh, "max_substeps", w.max_substeps);
  // A step over all frames since the last would take longer still, and the next one longer again.
  if (p.mode == Mode::kLive) w.most_frames = kMostLiveFrames;
  w.proximity = optionalParam(pnh, "proximity", w.proximity);
  w.contact_iterations = optionalParam(pnh, "contact_iterations", w.contact_iterations);
  w.contact_tolerance = optionalParam(pnh, "contact_tolerance", w.contact_tolerance);
  w.fem.element = elementTypeFromString(optionalParam(pnh, "element", toString(w.fem.element)));
  w.fem.material_model =
      materialModelFromString(optionalParam(pnh, "material_model", toString(w.fem.material_model)));
  w.fem.solver = solverKindFromString(optionalParam(pnh, "solver", toString(w.fem.solver)));
  w.fem.newton_iterations = optionalParam(pnh, "newton_iterations", 8);
  w.fem.newton_tolerance = optionalParam(pnh, "newton_tolerance", 1e-3);
  w.fem.linear_tolerance = optionalParam(pnh, "linear_tolerance", w.fem.linear_tolerance);
  readObjects(pnh, w);
  validate(w);
  return p;
}

}  // namespace calipso::fem

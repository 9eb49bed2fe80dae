#include "params.hpp"

#include <stdexcept>

#include "calipso_ros/node_main.hpp"

namespace calipso::flow {
namespace {

// Reads an optional number and checks its range.
template <class T>
void readNumber(const ros::NodeHandle& pnh, const std::string& name, double low, double high,
                T& value) {
  const double read = optionalParam(pnh, name, static_cast<double>(value));
  if (!(read >= low && read <= high)) {
    throw std::invalid_argument("parameter " + pnh.resolveName(name) + " is " +
                                std::to_string(read) + "; give " + std::to_string(low) + " to " +
                                std::to_string(high));
  }
  value = static_cast<T>(read);
}

DenseFlow::Preset readPreset(const ros::NodeHandle& pnh) {
  const std::string name = optionalParam<std::string>(pnh, "flow_preset", "ultrafast");
  if (name == "ultrafast") return DenseFlow::Preset::kUltrafast;
  if (name == "fast") return DenseFlow::Preset::kFast;
  if (name == "medium") return DenseFlow::Preset::kMedium;
  throw std::invalid_argument("parameter " + pnh.resolveName("flow_preset") + " is '" + name +
                              "'; give ultrafast, fast or medium");
}

}  // namespace

Params loadParams(const ros::NodeHandle& pnh) {
  Params params;
  params.scene = pathParam(pnh, "scene");
  params.mode = modeParam(pnh);
  params.flow_preset = readPreset(pnh);
  TrackerParams& tracker = params.dynamics.tracker;
  readNumber(pnh, "tracks", 8, 2000, tracker.seed_count);
  readNumber(pnh, "patch_radius_px", 3, kMostRadius, tracker.patch.radius_px);
  readNumber(pnh, "forward_backward_px", 0.01, 10.0, tracker.trust.forward_backward_px);
  readNumber(pnh, "search_px", 4.0, 500.0, tracker.search_px);
  readNumber(pnh, "collision_evidence", 0.0, 1000.0, params.dynamics.trajectory.least_evidence);
  readNumber(pnh, "cut_correlation", -1.0, 1.0, params.dynamics.cut_correlation);
  return params;
}

}  // namespace calipso::flow

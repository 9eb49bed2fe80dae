#include "calipso_fem/world/world_types.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

namespace calipso::fem {
namespace {

void require(bool ok, const std::string& name, double value, const std::string& range) {
  if (ok) return;
  std::ostringstream message;
  message << "parameter " << name << " = " << value << "; must be " << range;
  throw std::invalid_argument(message.str());
}

void validate(const ObjectSettings& s, const std::string& name) {
  if (s.youngs_modulus)
    require(*s.youngs_modulus > 0.0, name + "/youngs_modulus", *s.youngs_modulus, "> 0 (Pa)");
  if (s.poissons_ratio)
    require(*s.poissons_ratio > -1.0 && *s.poissons_ratio < 0.5, name + "/poissons_ratio",
            *s.poissons_ratio, "in (-1, 0.5)");
  if (s.density)
    require(*s.density > 0.0, name + "/density", *s.density,
            "> 0 (kg/m^3); .inf: nothing moves it");
  if (s.damping) require(*s.damping >= 0.0, name + "/damping", *s.damping, ">= 0 (s)");
  if (s.cell_size) require(*s.cell_size > 0.0, name + "/cell_size", *s.cell_size, "> 0 (m)");
  validate(s.surface, name);
}

}  // namespace

const ObjectSettings& WorldParams::settingsOf(const std::string& object) const {
  const auto found = objects.find(object);
  return found == objects.end() ? defaults : found->second;
}

void validate(const SurfaceSettings& s, const std::string& name) {
  require(s.friction >= 0.0 && std::isfinite(s.friction), name + "/friction", s.friction,
          ">= 0 and finite");
  require(s.rolling_friction >= 0.0, name + "/rolling_friction", s.rolling_friction, ">= 0 (m)");
  require(s.restitution >= 0.0 && s.restitution <= 1.0, name + "/restitution", s.restitution,
          "in [0, 1]");
  require(s.proximity >= 0.0, name + "/proximity", s.proximity, ">= 0 (m); 0: the world's");
}

void validate(const PairRule& r, const std::string& name) {
  if (r.friction)
    require(*r.friction >= 0.0 && std::isfinite(*r.friction), name + "/friction", *r.friction,
            ">= 0 and finite");
  if (r.restitution)
    require(*r.restitution >= 0.0 && *r.restitution <= 1.0, name + "/restitution", *r.restitution,
            "in [0, 1]");
  if (r.proximity)
    require(*r.proximity > 0.0 && std::isfinite(*r.proximity), name + "/proximity", *r.proximity,
            "> 0 (m)");
}

void validate(const WorldParams& p) {
  require(p.frame_period > 0.0, "frame_period", p.frame_period, "> 0 (s)");
  require(p.pixel_error > 0.0, "pixel_error", p.pixel_error, "> 0 (px)");
  require(p.max_nodes >= 8, "max_nodes", p.max_nodes, ">= 8");
  require(p.max_substeps >= 1, "max_substeps", p.max_substeps, ">= 1");
  require(p.proximity >= 0.0, "proximity", p.proximity, ">= 0 (m)");
  require(p.contact_iterations >= 1, "contact_iterations", p.contact_iterations, ">= 1");
  require(p.contact_tolerance > 0.0, "contact_tolerance", p.contact_tolerance, "> 0");
  validate(p.support, "support");
  validate(p.defaults, "defaults");
  for (const auto& [name, settings] : p.objects) validate(settings, "objects/" + name);
}

}  // namespace calipso::fem

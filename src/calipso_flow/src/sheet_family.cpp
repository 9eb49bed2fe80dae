#include "sheet_family.hpp"

#include <calipso_fem/voxel_grid.hpp>
#include <cmath>

namespace calipso::flow {

double cellSizeFor(const TriangleMesh& mesh, int nodes) {
  fem::VoxelizeOptions options;
  options.target_nodes = nodes;
  return fem::voxelize(mesh, options).cell_size;
}

SheetFamily::SheetFamily(const ObjectModel& model, const Eigen::Vector3d& gravity, double cell,
                         double simulator_cell, double longest_step, bool given)
    : model_(model), gravity_(gravity), given_(given), scale_(std::pow(simulator_cell / cell, 2)) {
  settings_.cell_size = cell;
  settings_.longest_step = longest_step;
  settings_.coarse_skin = true;
  at(kStiffStart);
  at(0.0);
}

SheetSimulation& SheetFamily::at(double log_stiffness) {
  return keep(sheet_, member(log_stiffness), settings_, sheet_.sheet.get());
}

const SheetSimulation& SheetFamily::stifferThan(double log_stiffness) {
  SheetSettings settings = settings_;
  settings.sag *= kStiffer;
  return keep(stiffer_, member(log_stiffness) + kStiffer, settings, &at(log_stiffness));
}

double SheetFamily::member(double log_stiffness) const {
  return given_ ? -std::log(scale_) : log_stiffness;
}

double SheetFamily::stiffnessOverDensity(double log_stiffness) {
  return at(log_stiffness).stiffnessRatio() / scale_;
}

SheetSimulation& SheetFamily::keep(Kept& kept, double log_stiffness, SheetSettings settings,
                                   const SheetSimulation* like) {
  if (!kept.sheet || kept.log_stiffness != log_stiffness) {
    settings.stiffness = scale_ * std::exp(log_stiffness);
    kept = {log_stiffness, std::make_unique<SheetSimulation>(model_, gravity_, settings, like)};
  }
  return *kept.sheet;
}

}  // namespace calipso::flow

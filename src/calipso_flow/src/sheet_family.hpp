#pragma once

#include <memory>

#include "sheet_simulation.hpp"

namespace calipso::flow {

constexpr double kStiffStart = 2.5;  // log s: of the stiffest member that the search starts from
// log s: how much stiffer the sheet is that shows what stiffness does
constexpr double kStiffer = 0.05;

double cellSizeFor(const TriangleMesh& mesh, int nodes);

// The sheet at any stiffness; those last asked for are kept, and what is asked for next starts from
// them.
class SheetFamily {
 public:
  // @throw as SheetSimulation
  // @param cell, simulator_cell  edges of this grid's cubes and of the simulator's, m
  // @param given  every member is as stiff as the simulator starts with, on this grid
  SheetFamily(const ObjectModel& model, const Eigen::Vector3d& gravity, double cell,
              double simulator_cell, double longest_step, bool given);

  bool given() const { return given_; }
  // @param log_stiffness  of the modulus over that which the simulator starts with, on its grid
  SheetSimulation& at(double log_stiffness);
  // The same by kStiffer stiffer, to tell what stiffness does: so much better settled than that
  // changes the shape.
  const SheetSimulation& stifferThan(double log_stiffness);
  double stiffnessOverDensity(double log_stiffness);

 private:
  struct Kept {
    double log_stiffness = 0.0;
    std::unique_ptr<SheetSimulation> sheet;
  };
  double member(double log_stiffness) const;
  SheetSimulation& keep(Kept& kept, double log_stiffness, SheetSettings settings,
                        const SheetSimulation* like);

  const ObjectModel& model_;
  Eigen::Vector3d gravity_;
  bool given_;
  SheetSettings settings_;
  double scale_;  // modulus with which this grid bends as the simulator's does, over the latter's
  Kept sheet_, stiffer_;
};

}  // namespace calipso::flow

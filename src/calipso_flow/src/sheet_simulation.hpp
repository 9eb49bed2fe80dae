#pragma once

#include <calipso_fem/world/soft_object.hpp>
#include <functional>
#include <optional>
#include <stdexcept>
#include <vector>

#include "calipso_flow/object_model.hpp"
#include "calipso_flow/wind_course.hpp"
#include "sheet_skin.hpp"
#include "sheet_step.hpp"
#include "sheet_tangent.hpp"

namespace calipso::flow {

using SurfaceVector = Eigen::VectorXd;  // 3 #V

// The sheet is too soft, or too badly held, to hang in its key-frame shape.
struct NoEquilibrium : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// A sheet's motion as seen by K linear measurements of its surface, and how it depends on the wind.
struct SheetMotion {
  Eigen::MatrixXd amplitudes;  // T x K
  // T x K each: by the wind at the knots, one component after the other, and by the logarithm of
  // the stiffness; empty when not asked for
  std::vector<Eigen::MatrixXd> slopes;
};

struct SheetSettings {
  int nodes = 120;                   // of the grid, about
  double cell_size = 0.0;            // m; > 0 overrides nodes
  double longest_step = 1.0 / 30.0;  // s
  double stiffness = 1.0;            // times the modulus that an object of its size starts with
  double sag = 1e-3;                 // of the diagonal, that the key frame's shape may give way by
  // the wind blows on triangles of half a cell instead of the surface's own
  bool coarse_skin = false;
};

// A thin object of the video as the simulator moves it in the wind: with the material an object of
// its size starts with, held where it is attached, in equilibrium in its key-frame shape.
class SheetSimulation {
 public:
  // @param like  the same sheet on the same grid, about as stiff, to start from; or null
  // @throw std::invalid_argument as the simulator does; NoEquilibrium
  SheetSimulation(const ObjectModel& model, const Eigen::Vector3d& gravity,
                  const SheetSettings& settings, const SheetSimulation* like = nullptr);

  using Wind = std::function<Eigen::Vector3d(double time)>;  // m/s, world
  // Displacements of the surface from the key frame's shape at every time, world axes, m.
  // @param velocities  of the surface at the first time, world axes, m/s
  std::vector<SurfaceVector> run(const std::vector<double>& times, const SurfaceVector& velocities,
                                 const Wind& wind);
  // The same, measured: amplitudes = measured * displacements of the surface.
  // @param displacements  of the surface at the first time, world axes, m
  // @param measured   K x 3 #V
  // @param stiffer    null: no slopes; else the same sheet, by a factor exp(`by`) as stiff
  SheetMotion measure(const std::vector<double>& times, const SurfaceVector& displacements,
                      const SurfaceVector& velocities, const WindCourse& wind,
                      const Eigen::MatrixXd& measured, const SheetSimulation* stiffer, double by);
  double stiffnessRatio() const { return stiffness_over_density_; }  // E/rho, m^2/s^2

 private:
  using InStep = std::function<void(double time, double h)>;
  // Steps through all times, with the wind of the middle of each step, whose time is told to
  // `in_step` while the body is in it.
  void move(const std::vector<double>& times, const SurfaceVector& displacements,
            const SurfaceVector& velocities, const Wind& wind, const InStep& in_step,
            const std::function<void()>& after_frame);
  void settle(const Eigen::Vector3d& gravity, double sag);
  // Of the nodal forces, 3 #N x P. @param dw  of the wind, 3 x P
  Slopes windSlopes(const Eigen::Vector3d& wind, double h, const MotionTangent& tangent,
                    const Slopes& dw) const;
  void blow(const Eigen::Vector3d& wind, double h);

  double longest_step_;   // s
  TriangleMesh surface_;  // world
  double areal_density_;  // kg/m^2
  double stiffness_over_density_;
  fem::SoftObject sheet_;
  SheetSkin skin_;
  std::optional<SheetStep> step_;
  Eigen::VectorXd start_;  // 3 #N, nodes in the key frame
};

}  // namespace calipso::flow

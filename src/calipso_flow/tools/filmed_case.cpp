#include "filmed_case.hpp"

#include <cmath>

#include "calipso_flow/clip_dynamics.hpp"
#include "film.hpp"
#include "json_entry.hpp"

namespace calipso::flow {
namespace {

// Root mean square error of the tracked surface over that of its true motion, percent.
double shapeError(const ObjectModel& model, const Shapes& shapes, const ObjectDynamics& found) {
  if (!found.deformation) return std::nan("");
  const Eigen::Matrix3d R = model.world_from_object.linear();
  double error = 0.0, motion = 0.0;
  for (size_t k = 0; k < shapes.size(); ++k) {
    const auto moved = found.deformation->modes.surface(
        model.mesh, found.deformation->modes.amplitudes.row(k).transpose());
    const Eigen::MatrixXd seen = (moved - model.mesh.vertices) * R.transpose();
    error += (seen - (shapes[k] - shapes[0])).squaredNorm();
    motion += (shapes[k] - shapes[0]).squaredNorm();
  }
  return 100.0 * std::sqrt(error / motion);
}

std::string windEntry(const std::string& name, const Eigen::Vector3d& wind,
                      const SheetTruth& settings = {}) {
  const FilmedSheet sheet = filmedSheet(wind, 45, settings);
  const ObjectDynamics found =
      analyseFilm(sheet.model, sheet.camera, sheet.shapes, sheet.times, sheet.gravity);
  JsonEntry entry;
  entry.text("case", name).text("object", sheet.model.name);
  entry.flag("deforms", found.deformation.has_value());
  double direction = std::nan(""), strength = std::nan(""), explained = std::nan(""),
         covered = std::nan("");
  if (found.deformation && found.deformation->wind) {
    const WindEstimate& w = *found.deformation->wind;
    direction = 180.0 / M_PI * std::acos(std::min(1.0, w.mean.normalized().dot(wind.normalized())));
    strength = 100.0 * std::abs(w.mean.norm() / wind.norm() - 1.0);
    explained = w.explained;
    const Eigen::Vector3d error = w.mean - wind;
    covered = error.dot(w.mean_covariance.ldlt().solve(error)) < 7.815;
    entry.numbers("wind_m_s", {w.mean.x(), w.mean.y(), w.mean.z()});
    const Eigen::Vector3d deviation = w.mean_covariance.diagonal().cwiseSqrt();
    entry.numbers("wind_deviation_m_s", {deviation.x(), deviation.y(), deviation.z()});
    entry.number("sheet_stiffness_m2_s2", w.stiffness_over_density);
  }
  entry.number("shape_error_percent", shapeError(sheet.model, sheet.shapes, found));
  entry.numbers("wind_true_m_s", {wind.x(), wind.y(), wind.z()});
  entry.number("wind_direction_error_deg", direction);
  entry.number("wind_strength_error_percent", strength);
  entry.number("wind_explained", explained).number("wind_covered_95", covered);
  if (found.deformation) entry.text("note", found.deformation->note);
  return entry.str();
}

std::string beamEntry(const std::string& name, double ratio) {
  const FilmedBeam beam = filmedBeam(ratio, 60);
  const ObjectDynamics found = analyseFilm(beam.model, beam.camera, beam.shapes, beam.times,
                                           Eigen::Vector3d(0.0, 0.0, -9.81));
  JsonEntry entry;
  entry.text("case", name).text("object", beam.model.name);
  entry.flag("deforms", found.deformation.has_value());
  double frequency = std::nan(""), stiffness = std::nan("");
  if (found.deformation && !found.deformation->lines.empty()) {
    const SpectralLine& line = found.deformation->lines.front().line;
    frequency = 100.0 * std::abs(line.naturalFrequency() / beam.frequency - 1.0);
    entry.number("frequency_hz", line.naturalFrequency())
        .number("frequency_true_hz", beam.frequency);
    if (found.deformation->stiffness) {
      stiffness = 100.0 * std::abs(found.deformation->stiffness->value / ratio - 1.0);
    }
  }
  entry.number("shape_error_percent", shapeError(beam.model, beam.shapes, found));
  entry.number("frequency_error_percent", frequency);
  entry.number("stiffness_ratio_error_percent", stiffness);
  if (found.deformation) entry.text("note", found.deformation->note);
  return entry.str();
}

}  // namespace

std::vector<std::string> evaluateFilmed() {
  SheetTruth as_coarse, default_grid, soft, pegged;
  as_coarse.nodes = 120, as_coarse.step = 1.0 / 30.0;
  default_grid.nodes = 1200, default_grid.step = 1.0 / 60.0;
  soft.stiffness = 0.3;
  pegged.pegged = true;
  return {windEntry("filmed_wind_ahead", {0.0, 4.0, 0.0}),
          windEntry("filmed_wind_aslant", {1.2, 4.0, 0.0}),
          windEntry("filmed_wind_back", {-0.8, -3.0, 0.0}),
          windEntry("filmed_wind_coarse", {0.0, 4.0, 0.0}, as_coarse),
          windEntry("filmed_wind_simulator", {0.0, 4.0, 0.0}, default_grid),
          windEntry("filmed_wind_soft", {0.0, 2.0, 0.0}, soft),
          windEntry("filmed_wind_pegged", {2.0, 4.0, 0.0}, pegged),
          beamEntry("filmed_beam", 15e3),
          beamEntry("filmed_beam_stiff", 40e3)};
}

}  // namespace calipso::flow

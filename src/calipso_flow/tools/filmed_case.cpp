#include "filmed_case.hpp"

#include <cmath>

#include "calipso_flow/clip_dynamics.hpp"
#include "film.hpp"
#include "json_entry.hpp"

namespace calipso::flow {
namespace {

constexpr double kMuchNoise = 8.0;       // grey levels
constexpr double kChiSquared95 = 7.815;  // with three degrees of freedom

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

// Adds how far the velocity of a surface as a whole, that of its vertices' mean, is from the truth,
// what the analysis states of that, and how often its 95 % ellipsoid holds the truth.
void addVelocity(const Shapes& shapes, const std::vector<double>& times,
                 const ObjectDynamics& found, JsonEntry& entry) {
  double error = 0.0, variance = 0.0, speed = 0.0, inside = 0.0;
  const size_t last = shapes.size() - 1;
  for (size_t k = 1; k < last; ++k) {
    const Eigen::Vector3d way = (shapes[k + 1] - shapes[k - 1]).colwise().mean().transpose();
    const Eigen::Vector3d v = way / (times[k + 1] - times[k - 1]);
    const Eigen::Vector3d off = found.motions[k].state.velocity - v;
    const Eigen::Matrix3d covariance =
        found.motions[k].state.twistCovariance().topLeftCorner<3, 3>();
    error += off.squaredNorm(), variance += covariance.trace(), speed += v.squaredNorm();
    inside += off.dot(covariance.ldlt().solve(off)) < kChiSquared95;
  }
  const double frames = static_cast<double>(last - 1);
  entry.number("velocity_error_percent", 100.0 * std::sqrt(error / speed));
  entry.number("velocity_error_m_s", std::sqrt(error / frames));
  entry.number("velocity_deviation_m_s", std::sqrt(variance / frames));
  entry.number("covered_95", inside / frames);
}

std::string windEntry(const std::string& name, const Eigen::Vector3d& full_wind,
                      const SheetTruth& settings = {}, double noise_grey = 2.0) {
  const FilmedSheet sheet = filmedSheet(full_wind, 45, settings);
  const Eigen::Vector3d& wind = sheet.wind;
  const ObjectDynamics found =
      analyseFilm(sheet.model, sheet.camera, sheet.shapes, sheet.times, sheet.gravity, noise_grey);
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
    covered = error.dot(w.mean_covariance.ldlt().solve(error)) < kChiSquared95;
    entry.numbers("wind_m_s", {w.mean.x(), w.mean.y(), w.mean.z()});
    const Eigen::Vector3d deviation = w.mean_covariance.diagonal().cwiseSqrt();
    entry.numbers("wind_deviation_m_s", {deviation.x(), deviation.y(), deviation.z()});
    entry.number("sheet_stiffness_m2_s2", w.stiffness_over_density);
  }
  entry.number("shape_error_percent", shapeError(sheet.model, sheet.shapes, found));
  addVelocity(sheet.shapes, sheet.times, found, entry);
  entry.numbers("wind_true_m_s", {wind.x(), wind.y(), wind.z()});
  entry.number("wind_direction_error_deg", direction);
  entry.number("wind_strength_error_percent", strength);
  entry.number("wind_explained", explained).number("wind_covered_95", covered);
  if (found.deformation) entry.text("note", found.deformation->note);
  return entry.str();
}

std::string beamEntry(const std::string& name, const BeamTruth& truth, double noise_grey = 2.0) {
  const FilmedBeam beam = filmedBeam(truth, 60);
  const ObjectDynamics found = analyseFilm(beam.model, beam.camera, beam.shapes, beam.times,
                                           Eigen::Vector3d(0.0, 0.0, -9.81), noise_grey);
  JsonEntry entry;
  entry.text("case", name).text("object", beam.model.name);
  entry.flag("deforms", found.deformation.has_value());
  double frequency = std::nan(""), stiffness = std::nan(""), second = std::nan("");
  if (found.deformation && !found.deformation->lines.empty()) {
    const SpectralLine& line = found.deformation->lines.front().line;
    frequency = 100.0 * std::abs(line.naturalFrequency() / beam.frequency - 1.0);
    entry.number("frequency_hz", line.naturalFrequency())
        .number("frequency_true_hz", beam.frequency);
    for (const SurfaceLine& other : found.deformation->lines) {
      const double off =
          100.0 * std::abs(other.line.naturalFrequency() / beam.second_frequency - 1.0);
      if (truth.second > 0.0 && !(off > second)) second = off;
    }
    if (found.deformation->stiffness) {
      stiffness =
          100.0 * std::abs(found.deformation->stiffness->value / truth.stiffness_ratio - 1.0);
    }
  }
  entry.number("shape_error_percent", shapeError(beam.model, beam.shapes, found));
  addVelocity(beam.shapes, beam.times, found, entry);
  entry.number("frequency_error_percent", frequency);
  entry.number("second_frequency_error_percent", second);
  entry.number("stiffness_ratio_error_percent", stiffness);
  if (found.deformation) entry.text("note", found.deformation->note);
  return entry.str();
}

}  // namespace

std::vector<std::string> evaluateFilmed() {
  SheetTruth as_coarse, default_grid, soft, pegged, small, wide, gusty;
  as_coarse.nodes = 120, as_coarse.step = 1.0 / 30.0;
  default_grid.nodes = 1200, default_grid.step = 1.0 / 60.0;
  soft.stiffness = 0.3;
  pegged.pegged = true;
  small.width = 0.4, small.height = 0.45;
  wide.width = 0.9, wide.height = 0.6;
  gusty.gust = 0.4;
  BeamTruth beam, stiff, damped, twofold;
  stiff.stiffness_ratio = 40e3;
  damped.damping = 0.0026;  // 2 % of the critical
  twofold.stiffness_ratio = 5e3, twofold.second = 0.5;
  return {windEntry("filmed_wind_ahead", {0.0, 4.0, 0.0}),
          windEntry("filmed_wind_aslant", {1.2, 4.0, 0.0}),
          windEntry("filmed_wind_back", {-0.8, -3.0, 0.0}),
          windEntry("filmed_wind_coarse", {0.0, 4.0, 0.0}, as_coarse),
          windEntry("filmed_wind_simulator", {0.0, 4.0, 0.0}, default_grid),
          windEntry("filmed_wind_soft", {0.0, 2.0, 0.0}, soft),
          windEntry("filmed_wind_pegged", {2.0, 4.0, 0.0}, pegged),
          windEntry("filmed_wind_behind", {0.0, -4.0, 0.0}),
          windEntry("filmed_wind_small", {0.0, 3.0, 0.0}, small),
          windEntry("filmed_wind_wide", {0.5, 3.5, 0.0}, wide),
          windEntry("filmed_wind_gusty", {0.0, 3.5, 0.0}, gusty),
          windEntry("filmed_wind_noisy", {0.0, 4.0, 0.0}, {}, kMuchNoise),
          beamEntry("filmed_beam", beam),
          beamEntry("filmed_beam_stiff", stiff),
          beamEntry("filmed_beam_damped", damped),
          beamEntry("filmed_beam_two_modes", twofold),
          beamEntry("filmed_beam_noisy", beam, kMuchNoise)};
}

}  // namespace calipso::flow

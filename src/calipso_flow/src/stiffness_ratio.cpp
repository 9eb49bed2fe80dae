#include "calipso_flow/stiffness_ratio.hpp"

#include <algorithm>
#include <calipso_fem/deformable_body.hpp>
#include <calipso_fem/modal_analysis.hpp>
#include <cmath>
#include <complex>
#include <exception>

namespace calipso::flow {
namespace {

constexpr int kNodes = 3000;
constexpr int kModes = 6;
constexpr double kLeastAgreement = 0.6;
constexpr double kSameFrequency = 0.02;  // relative

// Of what travels, which moves as much a quarter of a period later, no mode explains more than half.
double agreementOf(const Eigen::VectorXcd& observed, const Eigen::VectorXd& mode) {
  return std::norm(observed.dot(mode.cast<std::complex<double>>())) /
         (observed.squaredNorm() * mode.squaredNorm());
}

// Modes of nearly the same frequency, such as the two of a square beam, mix at will: what counts is
// the share of the shape that all of them explain.
double groupAgreement(const Eigen::VectorXcd& observed, const Eigen::MatrixXd& shapes,
                      const Eigen::VectorXd& frequencies, int mode) {
  double sum = 0.0;
  for (int m = 0; m < shapes.cols(); ++m) {
    if (std::abs(frequencies[m] / frequencies[mode] - 1.0) < kSameFrequency) {
      sum += agreementOf(observed, shapes.col(m));
    }
  }
  return std::min(1.0, sum);
}

}  // namespace

std::optional<StiffnessRatio> stiffnessRatio(const ObjectModel& model, const SpectralLine& line,
                                             const Eigen::VectorXcd& shape, std::string& note) {
  if (model.attached.empty()) {
    note =
        "no stiffness from the vibration: nothing says where the object is held; give an "
        "attachment hint";
    return std::nullopt;
  }
  Material nominal;
  nominal.youngs_modulus = nominal.density * 1e3;  // any ratio does
  fem::FemOptions options;
  options.target_nodes = kNodes;
  // A plane of the grid where the object is held: else a whole layer of cells is clamped.
  options.has_anchor = true;
  for (const int v : model.attached) options.anchor += model.mesh.vertex(v) / model.attached.size();
  fem::ModalResult modal;
  Eigen::MatrixXd shapes;
  try {
    const fem::DeformableBody body(model.mesh, nominal, options);
    std::vector<int> fixed;
    for (const int node : body.nodesOfSurfaceVertices(model.attached)) {
      for (int axis = 0; axis < 3; ++axis) fixed.push_back(3 * node + axis);
    }
    modal = fem::naturalFrequencies(body.model(), fixed, kModes, options.lumped_mass);
    shapes.resize(3 * model.mesh.vertexCount(), kModes);
    for (int m = 0; m < kModes; ++m) shapes.col(m) = body.embedding().apply(modal.modes.col(m));
  } catch (const std::exception& error) {
    note = std::string("no stiffness from the vibration: ") + error.what();
    return std::nullopt;
  }
  StiffnessRatio best;
  for (int m = 0; m < kModes; ++m) {
    const double agreement = groupAgreement(shape, shapes, modal.frequencies, m);
    if (agreement > best.agreement + 1e-9) best.agreement = agreement, best.mode = m;
  }
  if (!(best.agreement >= kLeastAgreement)) {
    note =
        "no stiffness from the vibration: its shape is none of the model's lowest; it may be "
        "driven, or held elsewhere";
    return std::nullopt;
  }
  const double ratio = line.naturalFrequency() / modal.frequencies[best.mode];
  best.value = nominal.youngs_modulus / nominal.density * ratio * ratio;
  best.deviation = 2.0 * best.value * line.deviation / line.frequency;
  return best;
}

}  // namespace calipso::flow

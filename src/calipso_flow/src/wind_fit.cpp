#include "wind_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace calipso::flow {
namespace {

constexpr int kTrials = 12;   // steps of one fit, also those that make things worse
constexpr int kFailures = 3;  // of these in a row
constexpr double kLeastDamping = 1.0, kDamping = 5.0;
constexpr double kPoor = 0.25, kGood = 0.75;  // of the gain that was expected
constexpr double kSettled = 0.02;             // m/s, a smaller step is the last
constexpr double kGained = 1e-2;              // of the cost: less to be gained, and it is the end
// the pictures' information over that beforehand: half of the deviation
constexpr double kSeen = 3.0;
constexpr double kSeenShare = 0.03;  // of the best direction's
constexpr double kHardlyShown = 0.5;
constexpr double kMostPersistent = 0.95;
// m/s: still air has no derivative, drag being quadratic
constexpr double kGuesses[] = {1.0, 2.0, 4.0, 8.0};
constexpr double kWeak = 2.0, kStrong = 4.0;  // m/s: of these the first guesses are simulated

// After Levenberg and Marquardt: from how far a step gained what the slopes promised.
class Damping {
 public:
  double value() const { return value_; }
  bool exhausted() const { return failed_ >= kFailures; }
  // @param gain  over the expected one; negative where things got worse
  void learn(double gain) {
    failed_ = gain > 0.0 ? 0 : failed_ + 1;
    if (gain < kPoor) value_ = std::max(kLeastDamping, (gain > 0.0 ? 1.0 : kDamping) * value_);
    if (gain > kGood) value_ = value_ <= kLeastDamping ? 0.0 : value_ / kDamping;
  }

 private:
  double value_ = 0.0;
  int failed_ = 0;
};

}  // namespace

WindFit::WindFit(SheetFamily& sheets, const ObjectModel& model, const std::vector<double>& times,
                 const DeformationModes& modes, const Eigen::Vector3d& gravity,
                 const WindParams& params)
    : sheets_(sheets),
      times_(times),
      modes_(modes),
      params_(params),
      down_(gravity.norm() > 0.0 ? Eigen::Vector3d(gravity.normalized())
                                 : Eigen::Vector3d::Zero()) {
  const Eigen::Matrix3d R = model.world_from_object.linear();
  Eigen::MatrixXd shapes(modes.shapes.rows(), modes.count());
  for (int m = 0; m < modes.count(); ++m) {
    const Eigen::Map<const Eigen::Matrix3Xd> shape(modes.shapes.col(m).data(), 3,
                                                   modes.shapes.rows() / 3);
    Eigen::Map<Eigen::Matrix3Xd>(shapes.col(m).data(), 3, shape.cols()) = R * shape;
  }
  measured_ = (shapes.transpose() * shapes).ldlt().solve(shapes.transpose());
  velocities_ = shapes * modes.velocities.row(0).transpose();
  displacements_ = shapes * modes.amplitudes.row(0).transpose();
  const double motion = std::sqrt(modes.amplitudes.squaredNorm() / modes.amplitudes.rows());
  deviations_ =
      (modes.deviations.array().square() + std::pow(params.model_error * motion, 2)).sqrt();
}

std::optional<SheetMotion> WindFit::simulated(const std::vector<double>& knots,
                                              const Eigen::VectorXd& w, bool slopes) const {
  WindCourse course{knots, {}};
  for (size_t i = 0; i < knots.size(); ++i) course.wind.push_back(w.segment<3>(3 * i));
  const double log_stiffness = w[3 * knots.size()];
  try {
    const SheetSimulation* stiffer = slopes ? &sheets_.stifferThan(log_stiffness) : nullptr;
    return sheets_.at(log_stiffness)
        .measure(times_, displacements_, velocities_, course, measured_, stiffer, kStiffer);
  } catch (const NoEquilibrium&) {
    return std::nullopt;
  }
}

WindFit::Linearised WindFit::linearise(const SheetMotion& motion) const {
  Linearised at{flat(motion.amplitudes - modes_.amplitudes), {}};
  at.J.resize(at.r.size(), motion.slopes.size());
  for (size_t p = 0; p < motion.slopes.size(); ++p) at.J.col(p) = flat(motion.slopes[p]);
  return at;
}

Eigen::MatrixXd WindFit::prior(const std::vector<double>& knots) const {
  const int n = static_cast<int>(knots.size());
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(3 * n + 1, 3 * n + 1);
  P(3 * n, 3 * n) = 1.0 / (params_.stiffness * params_.stiffness);
  const double level = 1.0 / (n * params_.strongest * params_.strongest);
  const double upright = 1.0 / (n * params_.rising * params_.rising);
  const Eigen::Matrix3d weight =
      level * Eigen::Matrix3d::Identity() + (upright - level) * down_ * down_.transpose();
  for (int i = 0; i < n; ++i) P.block<3, 3>(3 * i, 3 * i) = weight;
  for (int i = 0; i + 1 < n; ++i) {
    const double weight = 1.0 / (params_.change * params_.change * (knots[i + 1] - knots[i]));
    for (int a = 0; a < 3; ++a) {
      const int p = 3 * i + a, q = p + 3;
      P(p, p) += weight, P(q, q) += weight, P(p, q) -= weight, P(q, p) -= weight;
    }
  }
  return P;
}

std::optional<WindFit::Fitted> WindFit::solve(const std::vector<double>& knots,
                                              Eigen::VectorXd w) const {
  const Eigen::MatrixXd P = prior(knots);
  std::optional<SheetMotion> reached = simulated(knots, w, true);
  if (!reached) return std::nullopt;
  Linearised at = linearise(*reached);
  double cost = at.r.squaredNorm() + w.dot(P * w);
  Damping damping;
  for (int trial = 0; trial < kTrials && !damping.exhausted(); ++trial) {
    const Eigen::VectorXd step = stepFrom(at, P, w, damping.value()), tried = w + step;
    const double expected = (at.r + at.J * step).squaredNorm() + tried.dot(P * tried);
    if (cost - expected < kGained * cost || step.cwiseAbs().maxCoeff() < kSettled) break;
    std::optional<SheetMotion> motion = simulated(knots, tried, true);
    double gain = -1.0;  // over what was expected
    if (motion) {
      const Linearised there = linearise(*motion);
      const double value = there.r.squaredNorm() + tried.dot(P * tried);
      gain = (cost - value) / (cost - expected);
      if (value < cost) w = tried, at = there, cost = value, reached.swap(motion);
    }
    damping.learn(gain);
  }
  const Eigen::VectorXd seen = seenPart(at.J, P, w);
  return Fitted{seen, reached->amplitudes, seen == w, at.J.transpose() * at.J + P,
                cost, at.r.squaredNorm()};
}

Eigen::VectorXd WindFit::stepFrom(const Linearised& at, const Eigen::MatrixXd& P,
                                  const Eigen::VectorXd& w, double damping) const {
  Eigen::MatrixXd J = at.J;
  if (sheets_.given()) J.rightCols<1>().setZero();  // it stays as it is, though it is not known
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> seen(J.transpose() * J, P);
  const Eigen::MatrixXd& V = seen.eigenvectors();  // V' P V = 1
  const Eigen::VectorXd beforehand = V.transpose() * (P * w),
                        pictures = V.transpose() * (J.transpose() * at.r);
  Eigen::VectorXd along(w.size());
  for (int i = 0; i < w.size(); ++i) {
    const double information = seen.eigenvalues()[i];
    along[i] = information > leastInformation(seen.eigenvalues())
                   ? (pictures[i] + beforehand[i]) / ((1.0 + damping) * information + 1.0)
                   : beforehand[i];
  }
  return -(V * along);
}

std::optional<WindFit::Fitted> WindFit::steady(const Eigen::Vector3d& direction) const {
  if (sheets_.given()) return firstGuess(direction, 0.0);
  const double motion = flat(modes_.amplitudes).squaredNorm();
  std::optional<Fitted> best;
  for (const double log_stiffness : {0.0, kStiffStart}) {
    const std::optional<Fitted> guess = firstGuess(direction, log_stiffness);
    const std::optional<Fitted> fitted = guess ? solve({times_.front()}, guess->w) : std::nullopt;
    if (!fitted) continue;
    const bool none_shown = best && fitted->left > (1.0 - kHardlyShown) * motion &&
                            best->left > (1.0 - kHardlyShown) * motion;
    if (!best || fitted->cost < best->cost || none_shown) best = fitted;
    if (fitted->left < (1.0 - kWellShown) * motion) break;
  }
  return best;
}

// Drag is quadratic: what two winds do,  a(v) = a_0 + b v^2,  tells what others would.
std::optional<WindFit::Fitted> WindFit::firstGuess(const Eigen::Vector3d& direction,
                                                   double log_stiffness) const {
  const auto wind = [&](double strength) -> Eigen::VectorXd {
    return (Eigen::Vector4d() << strength * direction, log_stiffness).finished();
  };
  const std::optional<SheetMotion> weak = simulated({times_.front()}, wind(kWeak), false),
                                   strong = simulated({times_.front()}, wind(kStrong), false);
  if (!weak || !strong) return std::nullopt;
  std::optional<Fitted> best;
  for (const double strength : kGuesses) {
    const double share =
        (strength * strength - kWeak * kWeak) / (kStrong * kStrong - kWeak * kWeak);
    Fitted guess;
    guess.w = wind(strength);
    guess.amplitudes = weak->amplitudes + share * (strong->amplitudes - weak->amplitudes);
    guess.left = flat(guess.amplitudes - modes_.amplitudes).squaredNorm();
    if (!best || guess.left < best->left) best = guess;
  }
  return best;
}

Eigen::VectorXd WindFit::seenPart(const Eigen::MatrixXd& J, const Eigen::MatrixXd& P,
                                  const Eigen::VectorXd& w) const {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> seen(J.transpose() * J, P);
  const Eigen::MatrixXd& V = seen.eigenvectors();
  const auto is_seen = seen.eigenvalues().array() > leastInformation(seen.eigenvalues());
  if (is_seen.all()) return w;
  return V * is_seen.select(V.transpose() * (P * w), 0.0).matrix();
}

void WindFit::allowForPersistence(const Eigen::MatrixXd& amplitudes) {
  const Eigen::VectorXd r = flat(amplitudes - modes_.amplitudes);
  const int frames = static_cast<int>(times_.size());
  double square = 0.0, product = 0.0;
  for (int m = 0; m < modes_.count(); ++m) {
    const auto series = r.segment(m * frames, frames);
    square += series.squaredNorm();
    product += series.tail(frames - 1).dot(series.head(frames - 1));
  }
  const double correlation =
      square > 0.0 ? std::clamp(product / square, 0.0, kMostPersistent) : 0.0;
  spread_ *=
      std::sqrt(std::max(1.0, square / r.size()) * (1.0 + correlation) / (1.0 - correlation));
}

Eigen::VectorXd WindFit::flat(const Eigen::MatrixXd& amplitudes) const {
  const Eigen::MatrixXd scaled = (amplitudes.array() / (spread_ * deviations_.array())).matrix();
  return Eigen::Map<const Eigen::VectorXd>(scaled.data(), scaled.size());
}

double WindFit::leastInformation(const Eigen::VectorXd& information) const {
  return sheets_.given() ? -1.0 : std::min(kSeen, kSeenShare * information.maxCoeff());
}

}  // namespace calipso::flow

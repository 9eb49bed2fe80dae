#include "calipso_flow/turn_search.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core/utility.hpp>

#include "calipso_flow/coarse_search.hpp"
#include "calipso_flow/rotation.hpp"

namespace calipso::flow {
namespace {

constexpr double kStep = 0.25;  // rad, of the grid: half of it is what a rough match still finds
constexpr double kFirstSide = 12.0;  // px, to twice this: the object's size in the first look
constexpr int kMostReduced = 16;
constexpr size_t kLookedAtAgain = 40;  // hypotheses, at twice the size
constexpr double kAgainReach = 2.0;    // px of the first look
// of correlation per rad: of looks that are alike, the less turned
constexpr double kTurnPenalty = 0.02;

struct Hypothesis {
  Eigen::Isometry3d pose;
  double turn = 0.0;  // rad, from the prediction
  double score = -1.0;
};

// Reference and frame at a smaller size.
struct Pictures {
  ReferenceView reference;
  Frame frame;
  int factor;
  Pictures(const ReferenceView& full, const Frame& seen, int by)
      : reference(full.reduced(by)), frame(reduced(seen, by)), factor(by) {}
};

// Poses turned by the rotation vectors on a cubic grid within a ball.
std::vector<Hypothesis> turnedPoses(const TurnSearch& search) {
  const int n = static_cast<int>(std::floor(search.largest_turn / kStep));
  std::vector<Hypothesis> hypotheses;
  for (int i = -n; i <= n; ++i) {
    for (int j = -n; j <= n; ++j) {
      for (int k = -n; k <= n; ++k) {
        Vector6d motion = Vector6d::Zero();
        motion.tail<3>() = kStep * Eigen::Vector3d(i, j, k);
        if (motion.norm() > search.largest_turn) continue;
        hypotheses.push_back({movePose(search.predicted, search.pivot, motion), motion.norm()});
      }
    }
  }
  return hypotheses;
}

// @param reach  px of the full size
void place(const Pictures& pictures, const Eigen::AlignedBox2d& reach, const Eigen::Vector3d& pivot,
           Hypothesis& hypothesis) {
  const ReferenceView::Warped look =
      pictures.reference.warp(pictures.frame.camera, hypothesis.pose);
  hypothesis.score = -1.0;
  if (look.coverage == 0.0) return;
  const double factor = pictures.factor;
  const CoarseMatch match =
      matchCoarsely(look, pictures.frame.gray, {reach.min() / factor, reach.max() / factor}, 1);
  hypothesis.pose =
      shiftInPicture(pictures.frame.camera, hypothesis.pose, pivot, match.displacement);
  hypothesis.score = match.correlation - kTurnPenalty * hypothesis.turn;
}

// Places all hypotheses and sorts them, the likeliest first.
void placeAll(const Pictures& pictures, const Eigen::AlignedBox2d& reach,
              const Eigen::Vector3d& pivot, std::vector<Hypothesis>& hypotheses) {
  cv::parallel_for_({0, static_cast<int>(hypotheses.size())}, [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) place(pictures, reach, pivot, hypotheses[i]);
  });
  std::stable_sort(hypotheses.begin(), hypotheses.end(),
                   [](const Hypothesis& a, const Hypothesis& b) { return a.score > b.score; });
}

bool areNeighbours(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return vectorFromRotation(a.linear() * b.linear().transpose()).norm() < 1.01 * kStep;
}

}  // namespace

std::vector<Eigen::Isometry3d> searchTurned(const ReferenceView& reference, const Frame& frame,
                                            const TurnSearch& search, size_t count) {
  const double side = std::sqrt(static_cast<double>(reference.seenPixels()));
  int factor = 1;
  while (factor < kMostReduced && side >= 2.0 * factor * kFirstSide) factor *= 2;
  std::vector<Hypothesis> hypotheses = turnedPoses(search);
  placeAll(Pictures(reference, frame, factor), search.reach, search.pivot, hypotheses);
  if (factor > 1) {
    hypotheses.resize(std::min(kLookedAtAgain, hypotheses.size()));
    const Eigen::Vector2d near = Eigen::Vector2d::Constant(kAgainReach * factor);
    placeAll(Pictures(reference, frame, factor / 2), {-near, near}, search.pivot, hypotheses);
  }
  std::vector<Eigen::Isometry3d> best;
  for (const Hypothesis& hypothesis : hypotheses) {
    if (best.size() == count || hypothesis.score <= 0.0) break;
    const bool new_one = std::none_of(best.begin(), best.end(), [&](const Eigen::Isometry3d& pose) {
      return areNeighbours(pose, hypothesis.pose);
    });
    if (new_one) best.push_back(hypothesis.pose);
  }
  return best;
}

}  // namespace calipso::flow

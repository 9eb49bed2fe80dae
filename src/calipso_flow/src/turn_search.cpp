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
  TurnedPose turned;
  double turn = 0.0;  // rad, from the prediction
  double score = -1.0;
};

// References and frame at a smaller size.
struct Pictures {
  std::vector<ReferenceView> references;
  Frame frame;
  int factor;
  Pictures(const std::vector<const ReferenceView*>& full, const Frame& seen, int by)
      : frame(reduced(seen, by)), factor(by) {
    for (const ReferenceView* reference : full) references.push_back(reference->reduced(by));
  }
};

// From where the camera looks at the object, object frame.
Eigen::Vector3d viewedFrom(const Frame& frame, const Eigen::Isometry3d& pose,
                           const Eigen::Vector3d& pivot) {
  const Eigen::Vector3d camera = frame.camera.world_from_camera.translation();
  return (pose.inverse() * camera - pivot).normalized();
}

size_t nearestOf(const std::vector<const ReferenceView*>& references, const Frame& frame,
                 const Eigen::Isometry3d& pose, const Eigen::Vector3d& pivot) {
  const Eigen::Vector3d from = viewedFrom(frame, pose, pivot);
  const auto alike = [&](const ReferenceView* reference) {
    return viewedFrom(reference->frame(), reference->worldFromObject(), pivot).dot(from);
  };
  return std::max_element(references.begin(), references.end(),
                          [&](const auto* a, const auto* b) { return alike(a) < alike(b); }) -
         references.begin();
}

// Poses turned by the rotation vectors on a cubic grid within a ball.
std::vector<Hypothesis> turnedPoses(const std::vector<const ReferenceView*>& references,
                                    const Frame& frame, const TurnSearch& search) {
  const int n = static_cast<int>(std::floor(search.largest_turn / kStep));
  std::vector<Hypothesis> hypotheses;
  for (int i = -n; i <= n; ++i) {
    for (int j = -n; j <= n; ++j) {
      for (int k = -n; k <= n; ++k) {
        Vector6d motion = Vector6d::Zero();
        motion.tail<3>() = kStep * Eigen::Vector3d(i, j, k);
        if (motion.norm() > search.largest_turn) continue;
        const Eigen::Isometry3d pose = movePose(search.predicted, search.pivot, motion);
        hypotheses.push_back(
            {{pose, nearestOf(references, frame, pose, search.pivot)}, motion.norm()});
      }
    }
  }
  return hypotheses;
}

// @param reach  px of the full size
void place(const Pictures& pictures, const Eigen::AlignedBox2d& reach, const Eigen::Vector3d& pivot,
           Hypothesis& hypothesis) {
  TurnedPose& turned = hypothesis.turned;
  const ReferenceView::Warped look =
      pictures.references[turned.reference].warp(pictures.frame.camera, turned.pose);
  hypothesis.score = -1.0;
  if (look.coverage == 0.0) return;
  const double factor = pictures.factor;
  const CoarseMatch match =
      matchCoarsely(look, pictures.frame.gray, {reach.min() / factor, reach.max() / factor}, 1);
  turned.pose = shiftInPicture(pictures.frame.camera, turned.pose, pivot, match.displacement);
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

std::vector<TurnedPose> searchTurned(const std::vector<const ReferenceView*>& references,
                                     const Frame& frame, const TurnSearch& search, size_t count) {
  const double side = std::sqrt(static_cast<double>(references.front()->seenPixels()));
  int factor = 1;
  while (factor < kMostReduced && side >= 2.0 * factor * kFirstSide) factor *= 2;
  std::vector<Hypothesis> hypotheses = turnedPoses(references, frame, search);
  placeAll(Pictures(references, frame, factor), search.reach, search.pivot, hypotheses);
  if (factor > 1) {
    hypotheses.resize(std::min(kLookedAtAgain, hypotheses.size()));
    const Eigen::Vector2d near = Eigen::Vector2d::Constant(kAgainReach * factor);
    placeAll(Pictures(references, frame, factor / 2), {-near, near}, search.pivot, hypotheses);
  }
  std::vector<TurnedPose> best;
  for (const Hypothesis& hypothesis : hypotheses) {
    if (best.size() == count || hypothesis.score <= 0.0) break;
    const bool new_one = std::none_of(best.begin(), best.end(), [&](const TurnedPose& other) {
      return areNeighbours(other.pose, hypothesis.turned.pose);
    });
    if (new_one) best.push_back(hypothesis.turned);
  }
  return best;
}

}  // namespace calipso::flow

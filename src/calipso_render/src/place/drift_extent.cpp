#include "place/drift_extent.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>

#include "place/drift_search.hpp"
#include "place/masked_quantile.hpp"

namespace calipso::render {
namespace {

constexpr int kCell = 2;               // px of the grid that is labelled
constexpr int kAround = 5;             // cells across: differences are judged together
constexpr float kClearWay = 2.0f;      // cells between pictures that tell drift from rest
constexpr float kClearly = 1.3f;       // times, and
constexpr float kNoise = 0.5f;         // code values, by which one explains a place better
constexpr float kExplains = 0.6f;      // part of what changes that has to be explained
constexpr int kLeastPart = 50;         // one part in so many of the picture has to drift
constexpr int kRounds = 2;             // of labelling
constexpr float kBorder = 4.0f;        // cost of a border's length of a cell,
constexpr float kHiddenBorder = 1.0f;  // where no picture shows it
constexpr float kEdge = 0.7f;          // code values from cell to cell: half that cost
constexpr float kDoubt = 0.15f;        // what speaks for resting wherever anything is seen, and
constexpr float kGround = 0.3f;        // besides where a support plane is seen
constexpr float kStill = 0.5f;         // ... or nothing changes, and no drift can be tried
// for drifting where nothing is seen: of equal borders the one along what rests
constexpr float kHidden = 0.02f;
const cv::Point kNext[] = {{1, 0}, {0, 1}};

// Mean differences between pictures, per place.
struct Mean {
  cv::Mat sum, count;  // CV_32FC1

  explicit Mean(const cv::Size& size)
      : sum(cv::Mat::zeros(size, CV_32F)), count(cv::Mat::zeros(size, CV_32F)) {}
  void add(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask) {
    cv::Mat difference;
    cv::absdiff(a, b, difference);
    cv::add(sum, difference, sum, mask), cv::add(count, 1.0, count, mask);
  }
  cv::Mat around() const {
    cv::Mat sums, counts;
    cv::boxFilter(sum, sums, -1, {kAround, kAround}, {-1, -1}, false);
    cv::boxFilter(count, counts, -1, {kAround, kAround}, {-1, -1}, false);
    return sums / cv::max(counts, 1.0f);
  }
};

// How much places differ as if they rested and as if they drifted.
struct Misses {
  cv::Mat resting, drifting;  // CV_32FC1, code values
  cv::Mat known, seen;        // CV_8UC1: where both are; where any picture shows the place
  cv::Mat change;             // CV_32FC1: as `resting`, also where it is not known what drifts there
};

// @param tells CV_8UC1, != 0: what is seen there may come to drifting places
Misses missesOf(const std::vector<DriftPicture>& pictures, const std::vector<cv::Point2f>& shifts,
                const cv::Mat& tells) {
  const cv::Size size = tells.size();
  Mean resting(size), drifting(size), change(size);
  cv::Mat seen = cv::Mat::zeros(size, CV_8U);
  for (const DriftPicture& picture : pictures) seen |= picture.covered == 0;
  for (const std::size_t r : {std::size_t{0}, pictures.size() / 2, pictures.size() - 1}) {
    cv::Mat comes;
    cv::Mat((pictures[r].covered == 0) & tells).convertTo(comes, CV_32F, 1.0 / 255.0);
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      const cv::Point2f way = shifts[r] - shifts[i];
      if (std::hypot(way.x, way.y) < kClearWay) continue;
      const cv::Mat shown = (pictures[i].covered == 0) & (pictures[r].covered == 0),
                    both = shown & (displaced(comes, way, size) > 0.99f);
      change.add(pictures[i].grey, pictures[r].grey, shown);
      resting.add(pictures[i].grey, pictures[r].grey, both);
      drifting.add(pictures[i].grey, displaced(pictures[r].grey, way, size), both);
    }
  }
  cv::Mat changes = change.around();
  changes.setTo(INFINITY, change.count == 0.0f);
  return {resting.around(), drifting.around(), resting.count > 0.0f, seen, changes};
}

// A picture by cells.
cv::Mat cells(const cv::Mat& picture) {
  cv::Mat out;
  cv::resize(picture, out, picture.size() / kCell, 0, 0, cv::INTER_AREA);
  return out;
}

// Steps from a cell to the next that are there whenever both are seen. CV_32FC1, code values;
// infinite where they never are.
cv::Mat restingSteps(const std::vector<DriftPicture>& pictures, const cv::Point& next) {
  cv::Mat least;
  for (const DriftPicture& picture : pictures) {
    const cv::Rect here(0, 0, picture.grey.cols - next.x, picture.grey.rows - next.y);
    cv::Mat step;
    cv::absdiff(picture.grey(here), picture.grey(here + next), step);
    step.setTo(INFINITY, (picture.covered(here) | picture.covered(here + next)) != 0);
    least = least.empty() ? step : cv::Mat(cv::min(least, step));
  }
  return least;
}

// The labelling of least cost. @param speaks CV_32FC1, -1 to 1: for drifting
cv::Mat labelled(const std::vector<DriftPicture>& pictures, const cv::Mat& speaks) {
  const auto node = [&](const cv::Point& p) { return p.y * speaks.cols + p.x; };
  const int count = static_cast<int>(speaks.total());
  cv::detail::GCGraph<float> graph(count, 4 * count);
  for (int i = 0; i < count; ++i) {
    const float s = speaks.at<float>(i / speaks.cols, i % speaks.cols);
    graph.addTermWeights(graph.addVtx(), std::max(0.0f, s), std::max(0.0f, -s));
  }
  for (const cv::Point& next : kNext) {
    const cv::Mat steps = restingSteps(pictures, next);
    for (int v = 0; v < steps.rows; ++v) {
      for (int u = 0; u < steps.cols; ++u) {
        const float e = steps.at<float>(v, u) / kEdge,
                    cost = std::isinf(e) ? kHiddenBorder : kBorder / (1.0f + e * e);
        graph.addEdges(node({u, v}), node(cv::Point(u, v) + next), cost, cost);
      }
    }
  }
  graph.maxFlow();
  cv::Mat drifts(speaks.size(), CV_8U);
  for (int i = 0; i < count; ++i)
    drifts.at<std::uint8_t>(i / speaks.cols, i % speaks.cols) = graph.inSourceSegment(i) ? 255 : 0;
  return drifts;
}

// What speaks for drifting: CV_32FC1, -1 to 1. Empty if that does not explain most of what changes.
cv::Mat whatSpeaks(const Misses& m, const cv::Mat& ground) {
  const float noise = quantileOf(cv::min(m.resting, m.drifting), m.known, 0.25);
  const cv::Mat changes = m.known & (m.resting > 2.0f * noise + 2.0f * kNoise),
                drifts = m.known & (m.resting > kClearly * m.drifting + kNoise);
  if (cv::countNonZero(changes & drifts) < kExplains * cv::countNonZero(changes) ||
      kLeastPart * static_cast<std::size_t>(cv::countNonZero(drifts)) < drifts.total())
    return {};
  // What drifts changes as well: differences as it usually has them say little.
  const float usual = quantileOf(m.drifting, drifts, 0.75);
  cv::Mat speaks = (m.resting - m.drifting) / (m.resting + m.drifting + usual);
  speaks.setTo(0.0f, ~m.known);
  cv::subtract(speaks, kDoubt, speaks, m.seen), cv::add(speaks, kHidden, speaks, ~m.seen);
  if (!ground.empty()) cv::subtract(speaks, kGround, speaks, ground);
  // Beside what hides the drift (a window's trim beside a wing).
  cv::subtract(speaks, kStill, speaks, ~m.known & (m.change < 2.0f * noise + 2.0f * kNoise));
  return speaks;
}

}  // namespace

cv::Mat whereDrifting(const std::vector<DriftPicture>& pictures,
                      const std::vector<cv::Point2f>& shifts, const cv::Mat& ground) {
  std::vector<DriftPicture> small;
  std::vector<cv::Point2f> ways;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    small.push_back({cells(pictures[i].grey), cells(pictures[i].covered)});
    ways.push_back(shifts[i] / static_cast<float>(kCell));
  }
  const cv::Mat small_ground = ground.empty() ? ground : cells(ground);
  cv::Mat drifts(small[0].grey.size(), CV_8U, cv::Scalar(255));
  // Once what rests is known, nothing is expected to have come from there.
  for (int round = 0; round < kRounds; ++round) {
    const cv::Mat speaks = whatSpeaks(missesOf(small, ways, drifts), small_ground);
    if (speaks.empty()) return {};
    drifts = labelled(small, speaks);
  }
  cv::Mat where;
  cv::resize(drifts, where, pictures[0].grey.size(), 0, 0, cv::INTER_NEAREST);
  return where;
}

}  // namespace calipso::render

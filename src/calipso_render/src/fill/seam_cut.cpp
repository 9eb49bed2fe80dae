#include "fill/seam_cut.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <map>
#include <opencv2/imgproc.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>
#include <thread>
#include <utility>
#include <vector>

#include "fill/patch_cost.hpp"

namespace calipso::render {
namespace {

constexpr int kReach = 6;          // px by which a copy may grow
constexpr int kTile = 16;          // px of the squares in which copies wait for each other
constexpr int kFewest = 40;        // px of a copy that may grow
constexpr float kUnknown = 60.0f;  // code values by which what is not seen differs from all colours
constexpr int kNoCopy = -1;
constexpr int kGrainSide = 15;       // px of the square in which gradients are averaged
constexpr int kLivelySide = 7;       // and of what a copy has
constexpr float kBland = 0.8f;       // part of what it covers that a copy's gradients must have
constexpr float kLeastGrain = 1.0f;  // code values
const cv::Point kAround[] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};

float strengthAt(const cv::Mat& picture, const cv::Point& p, const cv::Point& q) {
  return static_cast<float>(cv::norm(picture.at<cv::Vec3f>(q) - picture.at<cv::Vec3f>(p)));
}

// Mean gradient around what may be copied.
cv::Mat liveliness(const cv::Mat& image, const cv::Mat& source) {
  cv::Mat strength(image.size(), CV_32F, cv::Scalar(0.0f)), weight = strength.clone();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < image.rows - 1; ++v) {
    for (int u = 0; u + 1 < image.cols; ++u) {
      const cv::Point p(u, v), right(u + 1, v), below(u, v + 1);
      if (!source.at<std::uint8_t>(p) || !source.at<std::uint8_t>(right) ||
          !source.at<std::uint8_t>(below))
        continue;
      strength.at<float>(p) = strengthAt(image, p, right) + strengthAt(image, p, below);
      weight.at<float>(p) = 1.0f;
    }
  }
  cv::blur(strength, strength, {kLivelySide, kLivelySide});
  cv::blur(weight, weight, {kLivelySide, kLivelySide});
  return strength / cv::max(weight, 1e-3);
}

// How much a step from a pixel to the next shows: the less, the more of them are around.
cv::Mat stepWeight(const cv::Mat& picture, const cv::Point& next) {
  cv::Mat grain(picture.size(), CV_32F, cv::Scalar(0.0f));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < picture.rows - next.y; ++v) {
    for (int u = 0; u + next.x < picture.cols; ++u) {
      grain.at<float>(v, u) = strengthAt(picture, {u, v}, cv::Point(u, v) + next);
    }
  }
  cv::blur(grain, grain, {kGrainSide, kGrainSide});
  return 1.0f / (grain + kLeastGrain);
}

cv::Rect aroundHole(const cv::Mat& hole, int margin) {
  const cv::Rect box = cv::boundingRect(hole);
  return cv::Rect(box.x - margin, box.y - margin, box.width + 2 * margin, box.height + 2 * margin) &
         cv::Rect({0, 0}, hole.size());
}

// A labelling of the hole's pixels by the way to what they are copies of.
class Seams {
 public:
  Seams(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& source, const cv::Mat& known,
        const InpaintParams& params, const cv::Mat& origin)
      : image_(image),
        hole_(hole),
        source_(source),
        known_(known),
        surface_(params.surface),
        sky_(params.sky),
        has_surface_(!surface_.empty()),
        has_sky_(!sky_.empty()),
        near_(aroundHole(hole, 1 + kGrainSide / 2)),
        lively_(liveliness(image, source)),
        label_(hole.size(), CV_32S, cv::Scalar(kNoCopy)),
        node_(hole.size(), CV_32S, cv::Scalar(kNoCopy)) {
    cv::Mat picture = image(near_).clone();
    std::map<std::pair<int, int>, int> labels;
    for (int v = 0; v < hole.rows; ++v) {
      int last = kNoCopy;  // most copies go on along a row
      for (int u = 0; u < hole.cols; ++u) {
        const cv::Vec2s from = origin.at<cv::Vec2s>(v, u);
        if (hole.at<std::uint8_t>(v, u) == 0 || from[0] < 0) continue;
        const cv::Point way(from[0] - u, from[1] - v);
        const int next = static_cast<int>(ways_.size());
        const int label = last != kNoCopy && ways_[last] == way
                              ? last
                              : labels.try_emplace({way.y, way.x}, next).first->second;
        last = label;
        if (label == next) ways_.push_back(way), pixels_.emplace_back();
        pixels_[label].emplace_back(u, v);
        label_.at<int>(v, u) = label;
        picture.at<cv::Vec3f>(cv::Point(u, v) - near_.tl()) = image.at<cv::Vec3f>(from[1], from[0]);
      }
    }
    right_ = stepWeight(picture, {1, 0}), down_ = stepWeight(picture, {0, 1});
  }

  // Every copy once, in order: only such as are out of each other's reach at the same time, with
  // the same result.
  void expandAll() {
    const std::vector<Turn> turns = inTurns();
    std::vector<std::atomic<bool>> done(pixels_.size());
    // Whom a turn waits for has begun before it.
#pragma omp parallel for schedule(monotonic : dynamic, 1)
    for (std::size_t i = 0; i < turns.size(); ++i) {
      for (const int other : turns[i].after) {
        while (!done[other].load(std::memory_order_acquire)) std::this_thread::yield();
      }
      expand(turns[i].label);
      done[turns[i].label].store(true, std::memory_order_release);
    }
  }

  void write(cv::Mat& origin) const {
    for (int v = 0; v < hole_.rows; ++v) {
      for (int u = 0; u < hole_.cols; ++u) {
        const int label = label_.at<int>(v, u);
        if (label == kNoCopy) continue;
        const cv::Point from = cv::Point(u, v) + ways_[label];
        origin.at<cv::Vec2s>(v, u) = {static_cast<short>(from.x), static_cast<short>(from.y)};
      }
    }
  }

 private:
  // A copy that may grow. It waits for those before it that reach where it does: others only take
  // pixels from a copy until its own turn.
  struct Turn {
    int label;
    int wave;                // more than those of all that it waits for
    std::vector<int> after;  // labels
  };

  // Who waits for fewer others has its turn first, of these the largest.
  std::vector<Turn> inTurns() const {
    std::vector<Turn> turns;
    const int reach = kReach + 1, columns = (hole_.cols + 2 * reach) / kTile + 1,
              rows = (hole_.rows + 2 * reach) / kTile + 1;
    std::vector<int> last_of(columns * rows, kNoCopy);  // turn in every tile
    for (std::size_t label = 0; label < pixels_.size(); ++label) {
      if (pixels_[label].size() < kFewest) continue;
      Turn turn{static_cast<int>(label), 0, {}};
      const int number = static_cast<int>(turns.size());
      for (const cv::Point& p : pixels_[label]) {
        for (int v = p.y / kTile; v <= (p.y + 2 * reach) / kTile; ++v) {
          for (int u = p.x / kTile; u <= (p.x + 2 * reach) / kTile; ++u) {
            int& last = last_of[v * columns + u];
            if (last != kNoCopy && last != number) {
              turn.after.push_back(turns[last].label);
              turn.wave = std::max(turn.wave, turns[last].wave + 1);
            }
            last = number;
          }
        }
      }
      turns.push_back(std::move(turn));
    }
    std::stable_sort(turns.begin(), turns.end(), [&](const Turn& a, const Turn& b) {
      return a.wave != b.wave ? a.wave < b.wave : pixels_[a.label].size() > pixels_[b.label].size();
    });
    return turns;
  }

  // Lets one copy grow over its neighbours to where the cost of all seams is least.
  void expand(int label) {
    const std::vector<cv::Point> pixels = mayTake(label);
    if (pixels.empty()) return;
    cv::detail::GCGraph<float> graph(static_cast<int>(pixels.size()) + 1,
                                     4 * static_cast<int>(pixels.size()));
    for (const cv::Point& p : pixels) node_.at<int>(p) = graph.addVtx();
    for (const cv::Point& p : pixels) {
      for (const cv::Point& d : kAround) addSeam(p, p + d, label, graph);
    }
    graph.addEdges(0, graph.addVtx(), 0.0f, 0.0f);  // it wants one
    graph.maxFlow();
    for (const cv::Point& p : pixels) {
      if (!graph.inSourceSegment(node_.at<int>(p))) label_.at<int>(p) = label;
    }
    for (const cv::Point& p : pixels) node_.at<int>(p) = kNoCopy;
  }

  bool inside(const cv::Point& p) const {
    return p.x >= 0 && p.y >= 0 && p.x < hole_.cols && p.y < hole_.rows;
  }

  bool suits(const cv::Point& p, const cv::Point& from) const {
    if (!inside(from) || source_.at<std::uint8_t>(from) == 0) return false;
    const cv::Point covered = p + ways_[label_.at<int>(p)];
    if (lively_.at<float>(from) < kBland * lively_.at<float>(covered)) return false;
    return !(has_surface_ && differ(surface_, p, from)) && !(has_sky_ && differ(sky_, p, from));
  }

  // Pixels of other copies around one that it has something to put on.
  std::vector<cv::Point> mayTake(int label) const {
    const cv::Rect own = cv::boundingRect(pixels_[label]),
                   box = cv::Rect(own.x - kReach, own.y - kReach, own.width + 2 * kReach,
                                  own.height + 2 * kReach) &
                         cv::Rect({0, 0}, hole_.size());
    cv::Mat around = cv::Mat::zeros(box.size(), CV_8U);
    for (const cv::Point& p : pixels_[label]) {
      if (label_.at<int>(p) == label) around.at<std::uint8_t>(p - box.tl()) = 255;
    }
    cv::dilate(around, around, cv::Mat::ones(2 * kReach + 1, 2 * kReach + 1, CV_8U));
    std::vector<cv::Point> near, pixels;
    cv::findNonZero(around, near);
    for (const cv::Point& p : near) {
      const cv::Point at = p + box.tl();
      const int other = label_.at<int>(at);
      if (other != label && other != kNoCopy && suits(at, at + ways_[label])) pixels.push_back(at);
    }
    return pixels;
  }

  const cv::Vec3f* seen(const cv::Point& p, int label) const {
    const cv::Point from = p + ways_[label];
    return inside(from) && source_.at<std::uint8_t>(from) != 0 ? &image_.at<cv::Vec3f>(from)
                                                               : nullptr;
  }

  // A metric, so that the best move can be found.
  static float difference(const cv::Vec3f* a, const cv::Vec3f* b) {
    if (a == nullptr || b == nullptr) return a == b ? 0.0f : kUnknown;
    return std::min(2.0f * kUnknown, static_cast<float>(cv::norm(*a - *b)));
  }

  float weight(const cv::Point& p, const cv::Point& q) const {
    const cv::Point first(std::min(p.x, q.x), std::min(p.y, q.y));
    return (p.y == q.y ? right_ : down_).at<float>(first - near_.tl());
  }

  // What shows of the border between two pixels.
  float seam(const cv::Point& p, int at_p, const cv::Point& q, int at_q) const {
    if (at_p == at_q) return 0.0f;
    return weight(p, q) *
           (difference(seen(p, at_p), seen(p, at_q)) + difference(seen(q, at_p), seen(q, at_q)));
  }

  float seamToKnown(const cv::Point& p, int label, const cv::Point& q) const {
    return 2.0f * weight(p, q) * difference(&image_.at<cv::Vec3f>(q), seen(q, label));
  }

  static void addCost(int node, float kept, float taken, cv::detail::GCGraph<float>& graph) {
    graph.addTermWeights(node, taken, kept);
  }

  void addSeam(const cv::Point& p, const cv::Point& q, int label,
               cv::detail::GCGraph<float>& graph) const {
    if (!inside(q)) return;
    const int own = label_.at<int>(p), other = label_.at<int>(q), node = node_.at<int>(p),
              beside = node_.at<int>(q);
    if (other == kNoCopy) {
      if (known_.at<std::uint8_t>(q) != 0)
        addCost(node, seamToKnown(p, own, q), seamToKnown(p, label, q), graph);
      return;
    }
    if (beside == kNoCopy) {
      addCost(node, seam(p, own, q, other), seam(p, label, q, other), graph);
      return;
    }
    if (beside < node) return;
    const float both_kept = seam(p, own, q, other), q_taken = seam(p, own, q, label),
                p_taken = seam(p, label, q, other);
    addCost(node, both_kept, p_taken, graph);
    addCost(beside, p_taken, 0.0f, graph);
    graph.addEdges(node, beside, std::max(0.0f, q_taken + p_taken - both_kept), 0.0f);
  }

  const cv::Mat &image_, &hole_, &source_, &known_, &surface_, &sky_;
  bool has_surface_, has_sky_;
  cv::Rect near_;         // what the steps' weights are told from
  cv::Mat lively_;        // CV_32FC1: gradients around what may be copied
  cv::Mat label_, node_;  // CV_32SC1: of the copy, and in the graph of the move at hand
  cv::Mat right_, down_;  // CV_32FC1: weights of steps, of what is near
  std::vector<cv::Point> ways_;
  std::vector<std::vector<cv::Point>> pixels_;  // of every copy, at first
};

}  // namespace

void cutSeams(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& source,
              const cv::Mat& known, const InpaintParams& params, cv::Mat& origin) {
  Seams seams(image, hole, source, known, params, origin);
  seams.expandAll();
  seams.write(origin);
}

}  // namespace calipso::render

#include "calipso_align/label_cut.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc/detail/gcgraph.hpp>

namespace calipso::align {
namespace {

// Half of the 8-neighbourhood: every pair is met once.
constexpr std::array<std::array<int, 2>, 4> kNeighbours = {{{1, 0}, {0, 1}, {1, 1}, {-1, 1}}};
constexpr int kMaxRounds = 3;

float squaredDistance(const cv::Vec3b& a, const cv::Vec3b& b) {
  const int d0 = a[0] - b[0], d1 = a[1] - b[1], d2 = a[2] - b[2];
  return static_cast<float>(d0 * d0 + d1 * d1 + d2 * d2);
}

class ExpansionMove {
 public:
  ExpansionMove(const cv::Mat& image, const cv::Mat& free, const std::vector<cv::Mat>& costs,
                const SmoothnessParams& params, const Relief* relief)
      : image_(image),
        free_(free),
        costs_(costs),
        params_(params),
        relief_(relief && relief->registered ? relief : nullptr),
        beta_(params.contrast_scale > 0.0f ? params.contrast_scale : contrastScale(image, free)),
        node_(free.size(), CV_32S) {}

  // Lets every free pixel choose between its label and `alpha`. Returns whether any did.
  bool run(int alpha, cv::Mat& labels) {
    const int nodes = numberNodes(alpha, labels);
    if (nodes == 0) return false;
    cv::detail::GCGraph<float> graph(nodes + 2, 8 * nodes + 2);
    for (int i = 0; i < nodes + 2; ++i) graph.addVtx();
    graph.addEdges(nodes, nodes + 1, 0.0f, 0.0f);  // GCGraph refuses a graph without any arc
    for (int y = 0; y < free_.rows; ++y)
      for (int x = 0; x < free_.cols; ++x) addPixel(x, y, alpha, labels, graph);
    graph.maxFlow();
    return take(alpha, graph, labels);
  }

 private:
  int numberNodes(int alpha, const cv::Mat& labels) {
    int count = 0;
    for (int y = 0; y < free_.rows; ++y)
      for (int x = 0; x < free_.cols; ++x) {
        const bool node = free_.at<uchar>(y, x) && labels.at<uchar>(y, x) != alpha &&
                          costs_[alpha].at<float>(y, x) < kForbidden;
        node_.at<int>(y, x) = node ? count++ : -1;
      }
    return count;
  }

  float weight(int x, int y, int dx, int dy) const {
    const float d =
        squaredDistance(image_.at<cv::Vec3b>(y, x), image_.at<cv::Vec3b>(y + dy, x + dx));
    float similarity = params_.floor + (1.0f - params_.floor) * std::exp(-beta_ * d);
    if (relief_) {
      const float j = jump(*relief_, {x, y}, {dx, dy});
      similarity *= std::exp(-params_.jump_scale * j * j);
    }
    return params_.gamma * similarity * (dx != 0 && dy != 0 ? 0.70710678f : 1.0f);
  }

  // Terms of pixel p and of its pairs with the four neighbours behind it. The source side keeps the
  // label, the sink side takes alpha: an arc p -> q is cut when p keeps and q changes.
  void addPixel(int x, int y, int alpha, const cv::Mat& labels, cv::detail::GCGraph<float>& graph) {
    const int p = node_.at<int>(y, x);
    if (p >= 0)
      graph.addTermWeights(p, costs_[alpha].at<float>(y, x),
                           std::min(costs_[labels.at<uchar>(y, x)].at<float>(y, x), kForbidden));
    for (const auto& [dx, dy] : kNeighbours) {
      const int qx = x + dx, qy = y + dy;
      if (qx < 0 || qx >= free_.cols || qy >= free_.rows) continue;
      const int q = node_.at<int>(qy, qx);
      if (p < 0 && q < 0) continue;
      addPair(p, q, labels.at<uchar>(y, x), labels.at<uchar>(qy, qx), alpha, weight(x, y, dx, dy),
              graph);
    }
  }

  static void addPair(int p, int q, int label_p, int label_q, int alpha, float w,
                      cv::detail::GCGraph<float>& graph) {
    if (p >= 0 && q >= 0) {
      // E(keep, keep) = w [lp != lq], E(keep, alpha) = E(alpha, keep) = w, E(alpha, alpha) = 0,
      // split into terms and two arcs (Kolmogorov and Zabih 2004).
      if (label_p == label_q) {
        graph.addEdges(p, q, w, w);
      } else {
        graph.addTermWeights(p, 0.0f, w);
        graph.addEdges(p, q, 0.0f, w);
      }
      return;
    }
    const int node = p >= 0 ? p : q;
    const int own = p >= 0 ? label_p : label_q;
    const int other = p >= 0 ? label_q : label_p;
    graph.addTermWeights(node, other == alpha ? 0.0f : w, other == own ? 0.0f : w);
  }

  bool take(int alpha, cv::detail::GCGraph<float>& graph, cv::Mat& labels) {
    bool changed = false;
    for (int y = 0; y < free_.rows; ++y)
      for (int x = 0; x < free_.cols; ++x) {
        const int node = node_.at<int>(y, x);
        if (node < 0 || graph.inSourceSegment(node)) continue;
        labels.at<uchar>(y, x) = static_cast<uchar>(alpha);
        changed = true;
      }
    return changed;
  }

  const cv::Mat& image_;
  const cv::Mat& free_;
  const std::vector<cv::Mat>& costs_;
  const SmoothnessParams params_;
  const Relief* relief_;
  const float beta_;
  cv::Mat node_;
};

}  // namespace

float contrastScale(const cv::Mat& image, const cv::Mat& mask) {
  double sum = 0.0;
  long count = 0;
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 1; x < mask.cols; ++x) {
      if (!mask.at<uchar>(y, x)) continue;
      sum += squaredDistance(image.at<cv::Vec3b>(y, x), image.at<cv::Vec3b>(y, x - 1));
      ++count;
    }
  return sum > 0.0 ? static_cast<float>(count / (2.0 * sum)) : 0.0f;
}

void cutLabels(const cv::Mat& image, const cv::Mat& free, const std::vector<cv::Mat>& costs,
               const SmoothnessParams& params, cv::Mat& labels, const Relief* relief) {
  ExpansionMove move(image, free, costs, params, relief);
  const int label_count = static_cast<int>(costs.size());
  // With two labels one move from "all background" is exact.
  if (label_count == 2) {
    labels.setTo(0, free);
    move.run(1, labels);
    return;
  }
  for (int round = 0; round < kMaxRounds; ++round) {
    bool changed = false;
    for (int alpha = label_count - 1; alpha >= 0; --alpha) changed |= move.run(alpha, labels);
    if (!changed) break;
  }
}

}  // namespace calipso::align

#include "seam_blend.hpp"

#include <vector>

namespace calipso::render {
namespace {

constexpr float kScreen =
    0.003f;  // inverse square of the distance, px, over which a seam is spread
// code values; what misses by much more is an edge of things, not a seam to be spread
constexpr float kEdge = 25.0f;
constexpr float kScreenEdge = 0.3f;  // kScreen of what an edge misses
constexpr float kRelax = 1.8f;       // of Gauss-Seidel
constexpr int kIterations = 30;
const cv::Point kAround[] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};

struct Node {
  int neighbours[4] = {-1, -1, -1, -1};  // -1: no unknown there
  int count = 0;                         // neighbours that pull, known ones included
  cv::Vec3f mismatch, edge;  // what the copies' differences leave over, as a seam and as an edge
  cv::Point at;
};

class Seams {
 public:
  Seams(const cv::Mat& hole, const cv::Mat& source, const cv::Mat& origin, const cv::Mat& image)
      : hole_(hole), source_(source), origin_(origin), image_(image) {}

  std::vector<Node> nodes() const {
    cv::Mat index(hole_.size(), CV_32S, cv::Scalar(-1));
    std::vector<Node> nodes;
    for (int v = 0; v < hole_.rows; ++v) {
      for (int u = 0; u < hole_.cols; ++u) {
        if (hole_.at<std::uint8_t>(v, u) == 0) continue;
        index.at<int>(v, u) = static_cast<int>(nodes.size());
        Node node;
        node.at = {u, v};
        nodes.push_back(node);
      }
    }
    for (Node& node : nodes) {
      for (int i = 0; i < 4; ++i) {
        const cv::Point q = node.at + kAround[i];
        if (!inside(q) || (index.at<int>(q) < 0 && source_.at<std::uint8_t>(q) == 0)) continue;
        node.neighbours[i] = index.at<int>(q);
        ++node.count;
        const cv::Vec3f miss = colour(q) - colour(node.at) - wanted(node.at, q);
        const cv::Vec3f seam = miss / (1.0f + miss.dot(miss) / (kEdge * kEdge));
        node.mismatch += seam, node.edge += miss - seam;
      }
    }
    return nodes;
  }

 private:
  bool inside(const cv::Point& p) const {
    return p.x >= 0 && p.y >= 0 && p.x < hole_.cols && p.y < hole_.rows;
  }
  bool isSource(const cv::Point& p) const { return inside(p) && source_.at<std::uint8_t>(p) != 0; }
  const cv::Vec3f& colour(const cv::Point& p) const { return image_.at<cv::Vec3f>(p); }

  // The difference from p to its neighbour q in the places that they are copies of, as far as it
  // can be seen there.
  cv::Vec3f wanted(const cv::Point& p, const cv::Point& q) const {
    cv::Vec3f sum;
    int seen = 0;
    for (const bool at_p : {true, false}) {
      const cv::Vec2s from = origin_.at<cv::Vec2s>(at_p ? p : q);
      if (from[0] < 0) continue;
      const cv::Point own(from[0], from[1]), other = at_p ? own + (q - p) : own + (p - q);
      if (!isSource(other)) continue;
      sum += at_p ? colour(other) - colour(own) : colour(own) - colour(other), ++seen;
    }
    return seen > 0 ? cv::Vec3f(sum / seen) : cv::Vec3f(0, 0, 0);
  }

  const cv::Mat &hole_, &source_, &origin_, &image_;
};

// What is added to a channel: mismatches spread by a screened Poisson equation. Known pixels, for
// which the last node stands, get nothing.
std::vector<float> spread(const std::vector<Node>& nodes, cv::Vec3f Node::*mismatch, int channel,
                          float screen) {
  std::vector<float> change(nodes.size() + 1, 0.0f);
  for (int k = 0; k < kIterations; ++k) {
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const Node& n = nodes[i];
      float sum = (n.*mismatch)[channel];
      for (const int j : n.neighbours) sum += j >= 0 ? change[j] : 0.0f;
      change[i] += kRelax * (sum / (n.count + screen) - change[i]);
    }
  }
  return change;
}

}  // namespace

void blendSeams(const cv::Mat& hole, const cv::Mat& source, const cv::Mat& origin, cv::Mat& image) {
  const std::vector<Node> nodes = Seams(hole, source, origin, image).nodes();
#pragma omp parallel for schedule(static)
  for (int c = 0; c < 3; ++c) {
    const std::vector<float> wide = spread(nodes, &Node::mismatch, c, kScreen),
                             narrow = spread(nodes, &Node::edge, c, kScreenEdge);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      float& value = image.at<cv::Vec3f>(nodes[i].at)[c];
      value = std::min(255.0f, std::max(0.0f, value + wide[i] + narrow[i]));
    }
  }
}

}  // namespace calipso::render

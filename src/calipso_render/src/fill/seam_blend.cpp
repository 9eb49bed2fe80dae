#include "fill/seam_blend.hpp"

#include <array>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_render/inpaint.hpp"
#include "fill/patch_cost.hpp"

namespace calipso::render {
namespace {

// inverse square of the distance, px, over which a seam is spread
constexpr float kScreen = 0.003f;
// code values; what misses by much more is an edge of things, not a seam to be spread
constexpr float kEdge = 25.0f;
// px of the square in which what misses at a surface's border with its seen part is told apart from
// what single edges miss there
constexpr int kAlongBorder = 9;
constexpr float kScreenEdge = 0.3f;  // kScreen of what an edge misses
// of successive overrelaxation: seams go on changing slowly far away, what an edge misses is
// settled soon
constexpr float kRelax = 1.8f, kRelaxEdge = 1.46f;
constexpr int kIterations = 30, kIterationsEdge = 12;
const cv::Point kAround[] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};

struct Links {
  int neighbours[4];   // what is no unknown is the node after the last, which nothing is added to
  float count = 0.0f;  // neighbours that pull, known ones included
};

// All of one colour, then all of the other: where either and their end begin.
struct Nodes {
  std::vector<cv::Point> places;
  std::vector<Links> links;
  std::vector<cv::Vec4f> seams, edges;  // what the copies' differences leave over, as which
  std::array<std::size_t, 3> first_of;
};

cv::Vec4f widened(const cv::Vec3f& c) { return {c[0], c[1], c[2], 0.0f}; }

class Seams {
 public:
  Seams(const cv::Mat& hole, const cv::Mat& source, const cv::Mat& origin, const cv::Mat& planes,
        const cv::Mat& sky, const cv::Mat& image)
      : hole_(hole),
        source_(source),
        origin_(origin),
        planes_(planes),
        sky_(sky),
        image_(image),
        has_planes_(!planes.empty()) {
    if (has_planes_) findBorderMiss();
  }

  // First one colour of a chessboard, then the other: a field's neighbours have the other one, so
  // that none waits for another of its colour.
  Nodes nodes() const {
    cv::Mat index(hole_.size(), CV_32S, cv::Scalar(-1));
    Nodes nodes;
    nodes.places.reserve(cv::countNonZero(hole_));
    for (int colour = 0; colour < 2; ++colour) {
      nodes.first_of[colour] = nodes.places.size();
      for (int v = 0; v < hole_.rows; ++v) {
        for (int u = (v + colour) % 2; u < hole_.cols; u += 2) {
          if (hole_.at<std::uint8_t>(v, u) == 0) continue;
          index.at<int>(v, u) = static_cast<int>(nodes.places.size());
          nodes.places.emplace_back(u, v);
        }
      }
    }
    const std::size_t count = nodes.places.size();
    nodes.first_of[2] = count;
    nodes.links.resize(count), nodes.seams.resize(count), nodes.edges.resize(count);
#pragma omp parallel for schedule(static)
    for (std::size_t k = 0; k < count; ++k) link(index, k, nodes);
    return nodes;
  }

 private:
  void link(const cv::Mat& index, std::size_t k, Nodes& nodes) const {
    const cv::Point p = nodes.places[k];
    Links& links = nodes.links[k];
    for (int i = 0; i < 4; ++i) {
      const cv::Point q = p + kAround[i];
      links.neighbours[i] = static_cast<int>(nodes.places.size());
      if (!inside(q) || (index.at<int>(q) < 0 && source_.at<std::uint8_t>(q) == 0)) continue;
      if (index.at<int>(q) >= 0 && has_planes_ && differ(planes_, p, q)) continue;
      if (index.at<int>(q) >= 0) links.neighbours[i] = index.at<int>(q);
      links.count += 1.0f;
      const cv::Vec3f miss = missOf(p, q);
      const cv::Vec3f edge =
          isOwnBorder(p, q) ? cv::Vec3f(miss - border_miss_.at<cv::Vec3f>(p)) : miss;
      const cv::Vec3f seam =
          isInSky(p, q) ? miss : miss / (1.0f + edge.dot(edge) / (kEdge * kEdge));
      nodes.seams[k] += widened(seam), nodes.edges[k] += widened(miss - seam);
    }
  }

  // What the fill misses on the whole where it meets what is seen of the same surface.
  void findBorderMiss() {
    border_miss_ = cv::Mat::zeros(hole_.size(), CV_32FC3);
    cv::Mat count = cv::Mat::zeros(hole_.size(), CV_32F), wide;
    for (int v = 0; v < hole_.rows; ++v) {
      for (int u = 0; u < hole_.cols; ++u) {
        if (hole_.at<std::uint8_t>(v, u) == 0) continue;
        for (const cv::Point& step : kAround) {
          const cv::Point p(u, v), q = p + step;
          if (!isOwnBorder(p, q)) continue;
          border_miss_.at<cv::Vec3f>(p) += missOf(p, q), count.at<float>(p) += 1.0f;
        }
      }
    }
    const cv::Size square(kAlongBorder, kAlongBorder);
    cv::boxFilter(border_miss_, border_miss_, -1, square, {-1, -1}, false);
    cv::boxFilter(count, count, -1, square, {-1, -1}, false);
    cv::cvtColor(cv::max(count, 1.0f), wide, cv::COLOR_GRAY2BGR);
    border_miss_ /= wide;
  }
  bool isOwnBorder(const cv::Point& p, const cv::Point& q) const {
    return has_planes_ && isSource(q) && hole_.at<std::uint8_t>(q) == 0 &&
           planes_.at<std::uint8_t>(p) != 0 &&
           planes_.at<std::uint8_t>(p) == planes_.at<std::uint8_t>(q);
  }
  cv::Vec3f missOf(const cv::Point& p, const cv::Point& q) const {
    return colour(q) - colour(p) - wanted(p, q);
  }

  bool inside(const cv::Point& p) const {
    return p.x >= 0 && p.y >= 0 && p.x < hole_.cols && p.y < hole_.rows;
  }
  bool isSource(const cv::Point& p) const { return inside(p) && source_.at<std::uint8_t>(p) != 0; }
  int skyAt(const cv::Point& p) const {
    const cv::Vec2s from = origin_.at<cv::Vec2s>(p);
    return sky_.at<std::uint8_t>(from[0] < 0 ? p : cv::Point(from[0], from[1]));
  }
  // Things have edges, the sky has none.
  bool isInSky(const cv::Point& p, const cv::Point& q) const {
    if (sky_.empty()) return false;
    const int own = skyAt(p), other = skyAt(q);
    return own != InpaintParams::kNoSky && other != InpaintParams::kNoSky &&
           (own == InpaintParams::kSky || other == InpaintParams::kSky);
  }
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

  const cv::Mat &hole_, &source_, &origin_, &planes_, &sky_, &image_;
  bool has_planes_;
  cv::Mat border_miss_;  // CV_32FC3
};

// What is added: mismatches spread by a screened Poisson equation, all channels at once. Known
// pixels, for which the last node stands, get nothing.
std::vector<cv::Vec4f> spread(const Nodes& nodes, const std::vector<cv::Vec4f>& mismatch,
                              float screen, float relax, int iterations) {
  std::vector<cv::Vec4f> change(nodes.places.size() + 1, cv::Vec4f::all(0.0f));
  const auto at = [&](int i) { return cv::v_load(change[i].val); };
#pragma omp parallel
  for (int k = 0; k < 2 * iterations; ++k) {
#pragma omp for schedule(static)
    for (std::size_t i = nodes.first_of[k % 2]; i < nodes.first_of[k % 2 + 1]; ++i) {
      const auto& [j, count] = nodes.links[i];
      const cv::v_float32x4 own = at(static_cast<int>(i)), sum = cv::v_load(mismatch[i].val) +
                                                                 at(j[0]) + at(j[1]) + at(j[2]) +
                                                                 at(j[3]);
      cv::v_store(change[i].val, own * cv::v_setall_f32(1.0f - relax) +
                                     sum * cv::v_setall_f32(relax / (count + screen)));
    }
  }
  return change;
}

}  // namespace

void blendSeams(const cv::Mat& hole, const cv::Mat& source, const cv::Mat& origin,
                const cv::Mat& planes, const cv::Mat& sky, cv::Mat& image) {
  const Nodes nodes = Seams(hole, source, origin, planes, sky, image).nodes();
  const std::vector<cv::Vec4f> wide = spread(nodes, nodes.seams, kScreen, kRelax, kIterations),
                               narrow = spread(nodes, nodes.edges, kScreenEdge, kRelaxEdge,
                                               kIterationsEdge);
  for (std::size_t i = 0; i < nodes.places.size(); ++i) {
    cv::Vec3f& colour = image.at<cv::Vec3f>(nodes.places[i]);
    for (int c = 0; c < 3; ++c)
      colour[c] = std::min(255.0f, std::max(0.0f, colour[c] + wide[i][c] + narrow[i][c]));
  }
}

}  // namespace calipso::render

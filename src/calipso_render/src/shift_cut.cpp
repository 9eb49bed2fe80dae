#include "shift_cut.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <opencv2/imgproc/detail/gcgraph.hpp>

namespace calipso::render {
namespace {

constexpr int kContext = 3;         // px around a pixel that must look alike under its shift
constexpr float kRimWeight = 3.0f;  // of the surroundings against a seam
constexpr float kAwayRow = 0.02f, kAwayColumn = 0.001f;  // code values per px of the finest level: places are layered
constexpr double kSamples = 1500.0;    // px that tell where a shift fits best at a finer level
constexpr float kImpossible = 500.0f;  // code values: nothing to copy there
const cv::Point kAround[] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};

float distance(const cv::Vec3f& a, const cv::Vec3f& b) {
  const float d0 = a[0] - b[0], d1 = a[1] - b[1], d2 = a[2] - b[2];
  return std::sqrt(d0 * d0 + d1 * d1 + d2 * d2);
}

}  // namespace

ShiftCut::ShiftCut(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& source, std::vector<cv::Point> shifts, float scale)
    : image_(image), hole_(hole), source_(source), labels_(hole.size(), CV_8U, cv::Scalar(kNone)),
      index_(hole.size(), CV_32S, cv::Scalar(-1)), shifts_(std::move(shifts)), scale_(scale) {
  CV_Assert(shifts_.size() < kNone);
  cv::Mat near_known;
  cv::dilate(source_, near_known, cv::Mat::ones(2 * kContext + 1, 2 * kContext + 1, CV_8U));
  int rims = 0;
  for (int v = 0; v < hole.rows; ++v) {
    for (int u = 0; u < hole.cols; ++u) {
      if (hole.at<std::uint8_t>(v, u) == 0) continue;
      index_.at<int>(v, u) = static_cast<int>(pixels_.size());
      pixels_.push_back({{u, v}, near_known.at<std::uint8_t>(v, u) != 0 ? rims++ : -1});
    }
  }
  rim_costs_.assign(rims * shifts_.size(), -1.0f);
}

// Mean difference between what is known around p and what the shift puts there.
float ShiftCut::rimCost(const cv::Point& p, const cv::Point& shift) const {
  float sum = 0.0f;
  int known = 0;
  for (int dv = -kContext; dv <= kContext; ++dv) {
    for (int du = -kContext; du <= kContext; ++du) {
      const cv::Point q = p + cv::Point(du, dv);
      if (!isSource(q)) continue;
      ++known;
      sum += isSource(q + shift) ? distance(colour(q), colour(q + shift)) : 0.2f * kImpossible;
    }
  }
  return known > 0 ? sum / known : 0.0f;
}

float ShiftCut::single(const Pixel& pixel, int label) {
  if (!fits(pixel.at, label)) return kImpossible;
  const cv::Point& s = shifts_[label];
  const float away = scale_ * (kAwayRow * std::abs(s.y) + kAwayColumn * std::abs(s.x));
  if (pixel.rim < 0) return away;
  float& cost = rim_costs_[pixel.rim * shifts_.size() + label];
  if (cost < 0.0f) cost = rimCost(pixel.at, s);
  return away + kRimWeight * cost;
}

// The seam between neighbours p with shift a and q with shift b: what either shift puts on the other's pixel.
float ShiftCut::pair(const cv::Point& p, const cv::Point& q, int a, int b) const {
  if (a == b) return 0.0f;
  if (a == kNone || b == kNone) return kImpossible;
  float cost = 0.0f;
  for (const cv::Point& x : {p, q}) {
    const cv::Point xa = x + shifts_[a], xb = x + shifts_[b];
    cost += isSource(xa) && isSource(xb) ? distance(colour(xa), colour(xb)) : 0.2f * kImpossible;
  }
  return cost;
}

void ShiftCut::start() {
  for (const Pixel& pixel : pixels_) {
    float best = kImpossible;
    for (int i = 0; i < static_cast<int>(shifts_.size()); ++i) {
      const float cost = single(pixel, i);
      if (cost < best) best = cost, labels_.at<std::uint8_t>(pixel.at) = static_cast<std::uint8_t>(i);
    }
  }
}

void ShiftCut::startFrom(const ShiftCut& coarse) {
  for (const Pixel& pixel : pixels_) {
    const std::uint8_t label = coarse.labels_.at<std::uint8_t>(pixel.at.y / 2, pixel.at.x / 2);
    labels_.at<std::uint8_t>(pixel.at) = fits(pixel.at, label) ? label : kNone;
  }
  repair();
}

// A pixel whose shift leads nowhere takes the best one alone.
void ShiftCut::repair() {
  for (const Pixel& pixel : pixels_) {
    if (labels_.at<std::uint8_t>(pixel.at) != kNone) continue;
    float best = kImpossible;
    for (int i = 0; i < static_cast<int>(shifts_.size()); ++i) {
      float cost = single(pixel, i);
      for (const cv::Point& d : kAround) {
        const cv::Point q = pixel.at + d;
        const bool inside = q.x >= 0 && q.y >= 0 && q.x < hole_.cols && q.y < hole_.rows;
        if (inside && labels_.at<std::uint8_t>(q) != kNone) cost += pair(pixel.at, q, i, labels_.at<std::uint8_t>(q));
      }
      if (fits(pixel.at, i) && (cost < best || labels_.at<std::uint8_t>(pixel.at) == kNone)) best = cost, labels_.at<std::uint8_t>(pixel.at) = static_cast<std::uint8_t>(i);
    }
  }
}

void ShiftCut::sweep(int reach) {
  for (int i = 0; i < static_cast<int>(shifts_.size()); ++i) expand(i, reach);
}

// Every pixel may keep its label or take the new one. The source side keeps, the sink side changes.
bool ShiftCut::expand(int label, int reach) {
  cv::Mat offered;
  if (reach >= 0) {
    const cv::Mat has = labels_ == label;
    if (cv::countNonZero(has) == 0) return false;
    cv::dilate(has, offered, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
  }
  std::vector<int> node(pixels_.size(), -1);
  int nodes = 0;
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const cv::Point& p = pixels_[i].at;
    const bool takes_part = labels_.at<std::uint8_t>(p) != label && fits(p, label) && (offered.empty() || offered.at<std::uint8_t>(p) != 0);
    if (takes_part) node[i] = nodes++;
  }
  if (nodes == 0) return false;
  cv::detail::GCGraph<float> graph(nodes + 2, 4 * nodes + 2);
  for (int i = 0; i < nodes + 2; ++i) graph.addVtx();
  graph.addEdges(nodes, nodes + 1, 0.0f, 0.0f);  // GCGraph refuses a graph without any arc
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    if (node[i] < 0) continue;
    const cv::Point& p = pixels_[i].at;
    const int own = labels_.at<std::uint8_t>(p);
    float keep = single(pixels_[i], own), change = single(pixels_[i], label);
    for (const cv::Point& d : kAround) {
      const cv::Point q = p + d;
      if (q.x < 0 || q.y < 0 || q.x >= hole_.cols || q.y >= hole_.rows) continue;
      const int other = index_.at<int>(q);
      if (other < 0) continue;
      const int theirs = labels_.at<std::uint8_t>(q);
      if (node[other] < 0) {
        keep += pair(p, q, own, theirs), change += pair(p, q, label, theirs);
      } else if (d.x + d.y > 0) {
        // Kolmogorov and Zabih's construction; a = both keep, b = only q changes, c = only p changes.
        const float b = pair(p, q, own, label), c = pair(p, q, label, theirs), a = std::min(pair(p, q, own, theirs), b + c);
        change += c - a;
        // E(p, q) = a + (c - a) x_p + (0 - c) x_q + (b + c - a) (1 - x_p) x_q, x = 1: changes
        graph.addEdges(node[i], node[other], b + c - a, 0.0f);
        graph.addTermWeights(node[other], 0.0f, c);
      }
    }
    // An arc from the source is cut by who changes, one to the sink by who keeps.
    const float least = std::min(keep, change);
    graph.addTermWeights(node[i], change - least, keep - least);
  }
  graph.maxFlow();
  bool changed = false;
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    if (node[i] < 0 || graph.inSourceSegment(node[i])) continue;
    labels_.at<std::uint8_t>(pixels_[i].at) = static_cast<std::uint8_t>(label);
    changed = true;
  }
  return changed;
}

std::vector<cv::Point> ShiftCut::refinedShifts(const cv::Mat& fine_image, const cv::Mat& fine_source) const {
  const auto known = [&](const cv::Point& p) {
    return p.x >= 0 && p.y >= 0 && p.x < fine_source.cols && p.y < fine_source.rows && fine_source.at<std::uint8_t>(p) != 0;
  };
  std::vector<cv::Point> refined;
  for (int i = 0; i < static_cast<int>(shifts_.size()); ++i) {
    cv::Mat around;
    cv::dilate(labels_ == i, around, cv::Mat::ones(9, 9, CV_8U));
    cv::resize(around, around, fine_source.size(), 0, 0, cv::INTER_NEAREST);
    around &= fine_source;
    if (cv::countNonZero(around) < 50) around = fine_source;
    const int step = 1 + static_cast<int>(std::sqrt(cv::countNonZero(around) / kSamples));
    float best = std::numeric_limits<float>::max();
    cv::Point best_shift = 2 * shifts_[i];
    for (int dv = -1; dv <= 1; ++dv) {
      for (int du = -1; du <= 1; ++du) {
        const cv::Point s = 2 * shifts_[i] + cv::Point(du, dv);
        double sum = 0.0;
        int count = 0;
        for (int v = 0; v < around.rows; v += step) {
          for (int u = 0; u < around.cols; u += step) {
            if (around.at<std::uint8_t>(v, u) == 0 || !known(cv::Point(u, v) + s)) continue;
            // What differs much is another thing, not the same one displaced.
            sum += std::min(distance(fine_image.at<cv::Vec3f>(v, u), fine_image.at<cv::Vec3f>(v + s.y, u + s.x)), 40.0f), ++count;
          }
        }
        const float mean = count > 0 ? static_cast<float>(sum / count) : std::numeric_limits<float>::max();
        if (mean < best) best = mean, best_shift = s;
      }
    }
    refined.push_back(best_shift);
  }
  return refined;
}

}  // namespace calipso::render

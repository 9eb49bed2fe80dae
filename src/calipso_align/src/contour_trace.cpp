#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "calipso_align/contour.hpp"

namespace calipso::align {
namespace {

// Directions along pixel sides: +u, +v, -u, -v.
constexpr std::array<std::array<int, 2>, 4> kStep = {{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};

// The directed pixel sides between a label and everything else, object on the right. Lattice
// vertex (X, Y) is the corner of four pixels, at pixel coordinates (X - 1/2, Y - 1/2).
class CrackLattice {
 public:
  CrackLattice(const cv::Mat& labels, int label)
      : sides_(cv::Mat::zeros(labels.rows + 1, labels.cols + 1, CV_8U)) {
    const auto inside = [&](int x, int y) {
      return x >= 0 && y >= 0 && x < labels.cols && y < labels.rows &&
             labels.at<uchar>(y, x) == label;
    };
    for (int y = 0; y < labels.rows; ++y)
      for (int x = 0; x < labels.cols; ++x) {
        if (!inside(x, y)) continue;
        if (!inside(x, y - 1)) sides_.at<uchar>(y, x) |= 1;
        if (!inside(x + 1, y)) sides_.at<uchar>(y, x + 1) |= 2;
        if (!inside(x, y + 1)) sides_.at<uchar>(y + 1, x + 1) |= 4;
        if (!inside(x - 1, y)) sides_.at<uchar>(y + 1, x) |= 8;
      }
  }

  const cv::Mat& sides() const { return sides_; }

  // Takes the loop through side `direction` of `vertex` out of the lattice: middles of its sides.
  std::vector<Eigen::Vector2d> takeLoop(cv::Point vertex, int direction) {
    std::vector<Eigen::Vector2d> points;
    while (sides_.at<uchar>(vertex) & (1 << direction)) {
      sides_.at<uchar>(vertex) &= static_cast<uchar>(~(1 << direction));
      const auto [dx, dy] = kStep[direction];
      points.emplace_back(vertex.x - 0.5 + 0.5 * dx, vertex.y - 0.5 + 0.5 * dy);
      vertex += cv::Point(dx, dy);
      direction = next(vertex, direction);
    }
    return points;
  }

 private:
  // Where two pixels meet at a corner the left turn joins them.
  int next(cv::Point vertex, int direction) const {
    for (int turn : {3, 0, 1})
      if (sides_.at<uchar>(vertex) & (1 << ((direction + turn) % 4))) return (direction + turn) % 4;
    return direction;
  }

  cv::Mat sides_;
};

// Twice the area, positive for clockwise on the screen (v down).
double signedArea(const std::vector<Eigen::Vector2d>& points) {
  double sum = 0.0;
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d& a = points[i];
    const Eigen::Vector2d& b = points[(i + 1) % points.size()];
    sum += a.x() * b.y() - a.y() * b.x();
  }
  return sum;
}

// Whether the edge at p is the object's own: neither the picture nor another object ends there.
bool isOwnEdge(const cv::Mat& labels, int label, const Eigen::Vector2d& p, double reach) {
  if (p.x() < 0.5 || p.y() < 0.5 || p.x() > labels.cols - 1.5 || p.y() > labels.rows - 1.5)
    return false;
  for (int y = std::max(0, static_cast<int>(std::ceil(p.y() - reach)));
       y <= std::min(labels.rows - 1, static_cast<int>(std::floor(p.y() + reach))); ++y)
    for (int x = std::max(0, static_cast<int>(std::ceil(p.x() - reach)));
         x <= std::min(labels.cols - 1, static_cast<int>(std::floor(p.x() + reach))); ++x) {
      const int other = labels.at<uchar>(y, x);
      if (other != 0 && other != label) return false;
    }
  return true;
}

ContourLoop makeLoop(std::vector<Eigen::Vector2d> points, const cv::Mat& labels, int label,
                     const ContourParams& params) {
  ContourLoop loop;
  loop.hole = signedArea(points) < 0.0;
  loop.points = std::move(points);
  for (const Eigen::Vector2d& p : loop.points) {
    loop.known.push_back(isOwnEdge(labels, label, p, params.occluder_px));
    loop.confidence.push_back(loop.known.back() ? 1.0f : 0.0f);
  }
  return loop;
}

}  // namespace

std::vector<ContourLoop> traceLoops(const cv::Mat& labels, int label, const ContourParams& params) {
  CrackLattice lattice(labels, label);
  std::vector<ContourLoop> loops;
  for (int y = 0; y < lattice.sides().rows; ++y)
    for (int x = 0; x < lattice.sides().cols; ++x)
      for (int direction = 0; direction < 4; ++direction) {
        if (!(lattice.sides().at<uchar>(y, x) & (1 << direction))) continue;
        std::vector<Eigen::Vector2d> points = lattice.takeLoop({x, y}, direction);
        if (static_cast<int>(points.size()) >= params.min_loop_points)
          loops.push_back(makeLoop(std::move(points), labels, label, params));
      }
  std::stable_sort(loops.begin(), loops.end(), [](const ContourLoop& a, const ContourLoop& b) {
    return a.hole != b.hole ? b.hole : a.points.size() > b.points.size();
  });
  return loops;
}

ObjectContour extractContour(const cv::Mat& image, const cv::Mat& labels, int label,
                             const std::string& object, const ContourParams& params) {
  ObjectContour contour{object, label, traceLoops(labels, label, params)};
  if (contour.loops.empty())
    throw std::invalid_argument("object '" + object + "' (label " + std::to_string(label) +
                                "): its mask has no outline of at least " +
                                std::to_string(params.min_loop_points) +
                                " points; mark it with a stroke or enlarge its rectangle");
  for (ContourLoop& loop : contour.loops) refineLoop(image, labels, label, params, loop);
  return contour;
}

}  // namespace calipso::align

#include "calipso_align/planar_pieces.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "calipso_align/relief.hpp"
#include "calipso_scene/disjoint_sets.hpp"

namespace calipso::align {
namespace {

bool isSurface(const Relief& relief, const cv::Point& p) {
  return cv::Rect(cv::Point(), relief.state.size()).contains(p) &&
         relief.state.at<uchar>(p) == Relief::kSurface;
}

float inverseDepth(const Relief& relief, const cv::Point& p) {
  return relief.surface.at<cv::Vec3f>(p)[2];
}

// How far the inverse depth bends at a pixel; negative: it or a neighbour has no surface.
float bend(const Relief& relief, const cv::Point& p, const cv::Point& step) {
  if (!isSurface(relief, p - step) || !isSurface(relief, p) || !isSurface(relief, p + step))
    return -1.0f;
  return std::abs(inverseDepth(relief, p - step) - 2.0f * inverseDepth(relief, p) +
                  inverseDepth(relief, p + step));
}

const cv::Point kRight(1, 0), kDown(0, 1);

// Least squares plane q = a + b u + c v.
struct PlaneFit {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  double qq = 0.0;
  void add(double u, double v, double q) {
    const Eigen::Vector3d x(1.0, u, v);
    A += x * x.transpose();
    b += q * x;
    qq += q * q;
  }
  void add(const PlaneFit& other) { A += other.A, b += other.b, qq += other.qq; }
  double count() const { return A(0, 0); }
  double mean() const { return b(0) / A(0, 0); }
  Eigen::Vector3d plane() const { return A.ldlt().solve(b); }
  double deviation() const {  // r.m.s.
    return std::sqrt(std::max(0.0, qq - b.dot(plane())) / count());
  }
  double deviationFrom(const Eigen::Vector3d& x) const {
    return std::sqrt(std::max(0.0, qq - 2.0 * x.dot(b) + x.dot(A * x)) / count());
  }
};

// Pieces reach to where their plane ends: pixels beside one that go on as it does.
cv::Mat withRims(const Relief& relief, const cv::Mat& pieces, float crease) {
  cv::Mat result = pieces.clone();
  for (int y = 0; y < pieces.rows; ++y)
    for (int x = 0; x < pieces.cols; ++x) {
      const cv::Point p(x, y);
      if (pieces.at<int>(p) != 0 || !isSurface(relief, p)) continue;
      for (const cv::Point& step : {kRight, -kRight, kDown, -kDown}) {
        const cv::Point inner = p + step;
        if (!isSurface(relief, inner) || pieces.at<int>(inner) == 0) continue;
        const float b = bend(relief, inner, step);  // of p, inner and the one behind it
        if (b < 0.0f || b > crease) continue;
        result.at<int>(p) = pieces.at<int>(inner);
        break;
      }
    }
  return result;
}

}  // namespace

// What bends in nine of ten places may be noise.
float creaseThreshold(const Relief& relief) {
  constexpr double kFlat = 0.9;
  constexpr float kBeyond = 2.0f;
  std::vector<float> bends;
  for (int y = 0; y < relief.state.rows; ++y)
    for (int x = 0; x < relief.state.cols; ++x)
      for (const cv::Point& step : {kRight, kDown}) {
        const float b = bend(relief, {x, y}, step);
        if (b >= 0.0f) bends.push_back(b);
      }
  if (bends.empty()) return 0.0f;
  const auto place = bends.begin() + static_cast<long>(kFlat * (bends.size() - 1));
  std::nth_element(bends.begin(), place, bends.end());
  return kBeyond * *place;
}

cv::Mat planarPieces(const Relief& relief, float crease) {
  constexpr double kLeastPixels = 30.0;
  const int rows = relief.state.rows, cols = relief.state.cols;
  // A crease is of neither side, and seen across it only: what is flat is so in both directions.
  cv::Mat flat = cv::Mat::zeros(relief.state.size(), CV_8U);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < cols; ++x) {
      const float across = bend(relief, {x, y}, kRight), down = bend(relief, {x, y}, kDown);
      flat.at<uchar>(y, x) = across >= 0.0f && down >= 0.0f && std::max(across, down) <= crease;
    }
  DisjointSets sets(rows * cols);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < cols; ++x)
      for (const cv::Point& step : {kRight, kDown}) {
        const cv::Point next = cv::Point(x, y) + step;
        if (next.x >= cols || next.y >= rows || !flat.at<uchar>(y, x) || !flat.at<uchar>(next))
          continue;
        sets.join(y * cols + x, next.y * cols + next.x);
      }

  std::vector<PlaneFit> planes(static_cast<size_t>(rows) * cols);
  std::vector<double> first(
      planes.size());  // q relative to the piece's first pixel keeps its digits
  const auto each = [&](const auto& action) {
    for (int y = 0; y < rows; ++y)
      for (int x = 0; x < cols; ++x)
        if (flat.at<uchar>(y, x)) action(x, y, sets.find(y * cols + x));
  };
  each([&](int x, int y, int piece) {
    if (planes[piece].count() == 0.0) first[piece] = inverseDepth(relief, {x, y});
    planes[piece].add(x - piece % cols, y - piece / cols,
                      inverseDepth(relief, {x, y}) - first[piece]);
  });
  std::vector<int> number(planes.size(), 0);
  int count = 0;
  for (size_t k = 0; k < planes.size(); ++k)
    if (planes[k].count() >= kLeastPixels && planes[k].deviation() <= crease) number[k] = ++count;
  cv::Mat pieces = cv::Mat::zeros(relief.state.size(), CV_32S);
  each([&](int x, int y, int piece) { pieces.at<int>(y, x) = number[piece]; });
  return withRims(relief, pieces, crease);
}

cv::Mat sharedPlanes(const Relief& relief, const cv::Mat& pieces) {
  constexpr double kLeast = 0.0017;  // of the picture: smaller ones lie near many planes
  // from a common plane they deviate hardly more than from their own; in the relief's units
  constexpr double kNoMore = 1.5, kNoise = 2.0;
  constexpr double kApart = 0.005;  // ... nor by that part of their inverse depth
  double most = 0.0;
  cv::minMaxLoc(pieces, nullptr, &most);
  std::vector<PlaneFit> fits(static_cast<size_t>(most) + 1);
  const cv::Point middle(pieces.cols / 2, pieces.rows / 2);  // numbers about it keep their digits
  for (int y = 0; y < pieces.rows; ++y)
    for (int x = 0; x < pieces.cols; ++x) {
      if (pieces.at<int>(y, x) == 0) continue;
      fits[pieces.at<int>(y, x)].add(x - middle.x, y - middle.y, inverseDepth(relief, {x, y}));
    }
  std::vector<size_t> order;  // the largest first
  for (size_t k = 1; k < fits.size(); ++k)
    if (fits[k].count() >= kLeast * static_cast<double>(pieces.total())) order.push_back(k);
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return fits[a].count() > fits[b].count(); });
  std::vector<PlaneFit> planes;
  std::vector<int> plane_of(fits.size(), 0);
  for (const size_t k : order) {
    for (size_t j = 0; j < planes.size() && plane_of[k] == 0; ++j) {
      PlaneFit both = planes[j];
      both.add(fits[k]);
      const Eigen::Vector3d plane = both.plane();
      const auto strays = [&](const PlaneFit& fit) {
        return fit.deviationFrom(plane) >
               std::min(kNoMore * fit.deviation() + kNoise, kApart * fit.mean());
      };
      if (strays(fits[k]) || strays(planes[j])) continue;
      planes[j] = both;
      plane_of[k] = static_cast<int>(j) + 1;
    }
    if (plane_of[k] != 0) continue;
    planes.push_back(fits[k]);
    plane_of[k] = static_cast<int>(planes.size());
  }
  cv::Mat result = cv::Mat::zeros(pieces.size(), CV_32S);
  for (int y = 0; y < pieces.rows; ++y)
    for (int x = 0; x < pieces.cols; ++x) result.at<int>(y, x) = plane_of[pieces.at<int>(y, x)];
  return result;
}

cv::Mat strokesOfPieces(const cv::Mat& pieces, const cv::Mat& strokes) {
  constexpr int kSeveral = -1;
  double most = 0.0;
  cv::minMaxLoc(pieces, nullptr, &most);
  std::vector<int> stroke(static_cast<size_t>(most) + 1, 0);
  for (int y = 0; y < pieces.rows; ++y)
    for (int x = 0; x < pieces.cols; ++x) {
      const int piece = pieces.at<int>(y, x), mark = strokes.at<uchar>(y, x);
      if (piece == 0 || mark == 0) continue;
      stroke[piece] = stroke[piece] == 0 || stroke[piece] == mark ? mark : kSeveral;
    }
  cv::Mat result = cv::Mat::zeros(pieces.size(), CV_8U);
  for (int y = 0; y < pieces.rows; ++y)
    for (int x = 0; x < pieces.cols; ++x)
      result.at<uchar>(y, x) = static_cast<uchar>(std::max(0, stroke[pieces.at<int>(y, x)]));
  return result;
}

}  // namespace calipso::align

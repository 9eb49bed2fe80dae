#include "fill/plane_chart.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

// times that what a chart shows may be nearer or farther than the middle of the hole
constexpr double kNearer = 1.8;
// times that the nearest of the hole must be as near as the farthest for the way it is seen to
// matter
constexpr double kTilted = 1.08;
constexpr int kLargest = 900;  // px of a chart's side
constexpr int kBorder = 4;     // px around what is charted

// The affine map after which `to_plane` leaves pixel c where it is, and the picture around it as it
// is.
cv::Matx33d keeping(const cv::Matx33d& to_plane, const cv::Point2d& c) {
  const cv::Vec3d x = to_plane * cv::Vec3d(c.x, c.y, 1.0);
  cv::Matx22d J;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) J(i, j) = (to_plane(i, j) - x[i] / x[2] * to_plane(2, j)) / x[2];
  }
  const cv::Matx22d A = J.inv();
  const cv::Vec2d b = cv::Vec2d(c.x, c.y) - A * cv::Vec2d(x[0] / x[2], x[1] / x[2]);
  return {A(0, 0), A(0, 1), b[0], A(1, 0), A(1, 1), b[1], 0.0, 0.0, 1.0};
}

// About a place.
cv::Matx33d turn(double angle, const cv::Point2d& c) {
  const double a = std::cos(angle), b = std::sin(angle);
  return {a, -b, c.x - a * c.x + b * c.y, b, a, c.y - b * c.x - a * c.y, 0.0, 0.0, 1.0};
}

double nearnessAt(const cv::Matx33d& to_plane, const cv::Point& p) {
  return to_plane(2, 0) * p.x + to_plane(2, 1) * p.y + to_plane(2, 2);
}

}  // namespace

std::optional<PlaneChart> planeChart(const cv::Matx33d& to_plane, const cv::Mat& hole,
                                     const cv::Mat& seen, double direction) {
  std::vector<cv::Point> inside, around;
  cv::findNonZero(hole, inside);
  cv::findNonZero(hole | seen, around);
  if (inside.empty()) return std::nullopt;
  cv::Point2d middle;
  double nearest = 0.0, farthest = 1e30;
  for (const cv::Point& p : inside) {
    middle += cv::Point2d(p) / static_cast<double>(inside.size());
    const double near = nearnessAt(to_plane, p);
    nearest = std::max(nearest, near), farthest = std::min(farthest, near);
  }
  const double own = nearnessAt(to_plane, middle);
  if (own <= 0.0 || farthest <= 0.0) return std::nullopt;
  PlaneChart chart;
  chart.tilted = nearest > kTilted * farthest;
  const cv::Matx33d whole =
      turn(-direction, middle) *
      (chart.tilted ? keeping(to_plane, middle) * to_plane : cv::Matx33d::eye());
  cv::Point2d least(1e9, 1e9), most(-1e9, -1e9);
  for (const cv::Point& p : around) {
    const double near = nearnessAt(to_plane, p);
    if (near > kNearer * own || kNearer * near < own) continue;
    const cv::Point2d x = taken(whole, p.x, p.y);
    least = {std::min(least.x, x.x), std::min(least.y, x.y)};
    most = {std::max(most.x, x.x), std::max(most.y, x.y)};
  }
  // Of a plane that leads far away, what is around the hole.
  least.x = std::max(least.x, middle.x - kLargest / 2),
  least.y = std::max(least.y, middle.y - kLargest / 2);
  most.x = std::min(most.x, middle.x + kLargest / 2),
  most.y = std::min(most.y, middle.y + kLargest / 2);
  const cv::Matx33d shift(1, 0, kBorder - std::floor(least.x), 0, 1, kBorder - std::floor(least.y),
                          0, 0, 1);
  chart.to_chart = shift * whole, chart.to_picture = chart.to_chart.inv();
  chart.size = {static_cast<int>(most.x - least.x) + 2 * kBorder,
                static_cast<int>(most.y - least.y) + 2 * kBorder};
  chart.places = cv::Mat(chart.size, CV_32FC2);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < chart.size.height; ++v) {
    for (int u = 0; u < chart.size.width; ++u) {
      const cv::Vec3d x = chart.to_picture * cv::Vec3d(u, v, 1.0);
      const cv::Point2d p(x[0] / x[2], x[1] / x[2]);
      const bool in = p.x > -1.0 && p.y > -1.0 && p.x < hole.cols && p.y < hole.rows &&
                      nearnessAt(to_plane, p) > 0.0;
      chart.places.at<cv::Vec2f>(v, u) = in ? cv::Vec2f(p.x, p.y) : cv::Vec2f(-8.0f, -8.0f);
    }
  }
  return chart;
}

cv::Mat PlaneChart::whole(const cv::Mat& mask) const {
  cv::Mat carried;
  cv::remap(mask != 0, carried, places, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT, 0);
  return carried == 255;
}

cv::Mat PlaneChart::any(const cv::Mat& mask) const {
  cv::Mat carried;
  cv::remap(mask != 0, carried, places, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT, 0);
  return carried != 0;
}

cv::Mat PlaneChart::carried(const cv::Mat& image) const { return carried(image, {{0, 0}, size}); }

cv::Mat PlaneChart::carried(const cv::Mat& image, const cv::Rect& part) const {
  cv::Mat carried;
  cv::remap(image, carried, places(part), cv::noArray(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return carried;
}

}  // namespace calipso::render

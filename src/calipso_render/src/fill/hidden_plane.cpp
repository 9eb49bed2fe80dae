#include "fill/hidden_plane.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "draw/side_by_side.hpp"
#include "fill/around_hole.hpp"
#include "fill/line_ends.hpp"
#include "fill/row_periods.hpp"
#include "fill/stripes.hpp"

namespace calipso::render {
namespace {

// slope of edges that go on in stripes: others are their pattern
constexpr float kAlongRow = 0.05f;
constexpr double kUsualWidth = 640.0;  // px of a picture; in wider ones tiles are larger, too
constexpr int kClear = 2;              // px around a sample that see nothing else

// @param beside CV_8UC1, != 0: where another surface is seen
PlanePart partOf(const PlaneChart& chart, const cv::Mat& hole, const cv::Mat& seen,
                 const cv::Mat& beside) {
  const auto square = [](int radius) {
    return cv::Mat(cv::Mat::ones(2 * radius + 1, 2 * radius + 1, CV_8U));
  };
  cv::Mat copied_from, off;
  cv::erode(seen, copied_from, square(kClear));
  cv::dilate(beside, off, square(kClear + kOutlineError));
  copied_from.setTo(0, off);
  PlanePart part{chart, {}, {}, {}, chart.any(hole), chart.whole(seen), chart.whole(copied_from),
                 {}};
  part.known &= part.hole == 0, part.source &= part.hole == 0;
  return part;
}

}  // namespace

cv::Mat nearnessOf(const cv::Matx33d& to_plane, const cv::Size& size) {
  cv::Mat nearness(size, CV_32F);
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u)
      nearness.at<float>(v, u) =
          static_cast<float>(to_plane(2, 0) * u + to_plane(2, 1) * v + to_plane(2, 2));
  }
  return nearness;
}

std::optional<PlanePart> chartedPart(const HiddenPlane& plane) {
  const std::optional<PlaneChart> chart = planeChart(plane.to_plane, plane.hole, plane.seen);
  if (!chart) return std::nullopt;
  PlanePart part = partOf(*chart, plane.hole, plane.seen, plane.beside);
  if (cv::countNonZero(part.hole) == 0 || cv::countNonZero(part.source) == 0) return std::nullopt;
  return part;
}

void addLook(const cv::Mat& look, const cv::Mat& seen, PlanePart& part) {
  // What is not seen of the plane would shine through to what is.
  part.plain = smoothFill(look, seen == 0, seen);
  const cv::Mat carried = part.chart.carried(part.plain);
  doAll(true, {[&] { part.edges = straightEdges(part.source, carried); },
               [&] { part.look = smoothFill(carried, part.known == 0, part.known); }});
}

void addLattice(const cv::Mat& look, int margin, PlanePart& part) {
  const double size = std::max(1.0, look.cols / kUsualWidth);
  const int around = cvRound(size * margin);
  const cv::Rect near = windowAround(part.hole, around, around);
  part.pattern.lattice =
      findLattice(part.chart.carried(look, near), part.source(near), cvRound(std::log2(size)));
}

bool turnAlongStripes(const cv::Mat& look, HiddenPlane& plane) {
  PlanePart& part = *plane.part;
  const auto direction = stripesAcross(part.look.empty() ? part.chart.carried(look) : part.look,
                                       part.hole, part.source);
  if (!direction) return false;
  part = partOf(*planeChart(plane.to_plane, plane.hole, plane.seen, *direction), plane.hole,
                plane.seen, plane.beside);
  addLook(look, plane.seen, part);
  part.pattern.striped = true, part.pattern.periods = rowPeriods(part.look, part.source);
  // The edges of what repeats itself end where it does, and what leads across stripes is a mark too.
  const auto is_mark = [&](const cv::Vec4f& e) {
    const int row = std::clamp(cvRound(0.5f * (e[1] + e[3])), 0, part.look.rows - 1);
    return part.pattern.periods[row] > 0.0f ||
           std::abs(e[3] - e[1]) > kAlongRow * std::abs(e[2] - e[0]);
  };
  part.edges.erase(std::remove_if(part.edges.begin(), part.edges.end(), is_mark), part.edges.end());
  return true;
}

}  // namespace calipso::render

#include "place/drift_search.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "place/drift_extent.hpp"
#include "working_size.hpp"

namespace calipso::render {
namespace {

constexpr int kCoarse = 4;         // px of the picture: the grid on which a first guess is sought;
constexpr int kColumns = 160;      // in wide pictures first on one of so many columns
constexpr float kChanged = 6.0f;   // code values, there: beyond noise
constexpr float kEdge = 2.0f;      // code values from one of its pixels to the next
constexpr float kMostOff = 20.0f;  // code values: what is off by more counts as that much
constexpr int kFewestPoints = 60;  // that change
constexpr std::size_t kMostPoints = 5000;  // by which a displacement is judged
constexpr float kGuessed = 0.5f;           // part of the differences that a guess may leave
constexpr int kJudged = 15;                // px across: differences are judged together
constexpr float kLeastWay = 3.0f;          // px that it has to come in the clip
constexpr int kStride = 2;                 // px between places by which frames are registered
constexpr double kFarStep = 16.0;          // px, of one of them: astray
constexpr int kRounds = 12;                // of registering
constexpr float kOutlier = 10.0f;          // code values
constexpr int kOff = 9;                    // px from the borders of what rests

bool isFree(const DriftPicture& picture, int u, int v) {
  return u >= 0 && v >= 0 && u < picture.grey.cols && v < picture.grey.rows &&
         picture.covered.at<std::uint8_t>(v, u) == 0;
}

DriftPicture coarse(const DriftPicture& picture, int cell) {
  DriftPicture out;
  const cv::Size size(std::max(1, picture.grey.cols / cell), std::max(1, picture.grey.rows / cell));
  cv::resize(picture.grey, out.grey, size, 0, 0, cv::INTER_AREA);
  cv::resize(picture.covered, out.covered, size, 0, 0, cv::INTER_AREA);
  return out;
}

// Places that change between two pictures and stand out from what is around.
std::vector<cv::Point> tellingPoints(const DriftPicture& from, const DriftPicture& to) {
  std::vector<cv::Point> points;
  for (int v = 1; v + 1 < from.grey.rows; ++v) {
    for (int u = 1; u + 1 < from.grey.cols; ++u) {
      if (!isFree(from, u, v) || !isFree(to, u, v)) continue;
      const float here = from.grey.at<float>(v, u),
                  right = from.grey.at<float>(v, u + 1) - from.grey.at<float>(v, u - 1),
                  down = from.grey.at<float>(v + 1, u) - from.grey.at<float>(v - 1, u);
      if (std::abs(to.grey.at<float>(v, u) - here) > kChanged &&
          std::hypot(right, down) > 2.0f * kEdge)
        points.push_back({u, v});
    }
  }
  const std::size_t step = 1 + points.size() / kMostPoints;
  std::vector<cv::Point> some;
  for (std::size_t i = 0; i < points.size(); i += step) some.push_back(points[i]);
  return some;
}

// Mean difference at points displaced by `by`; none if few of them stay in the picture.
std::optional<float> missAt(const DriftPicture& from, const DriftPicture& to,
                            const std::vector<cv::Point>& points, const cv::Point& by) {
  float sum = 0.0f;
  std::size_t count = 0;
  for (const cv::Point& p : points) {
    if (!isFree(to, p.x + by.x, p.y + by.y)) continue;
    sum += std::min(kMostOff, std::abs(to.grey.at<float>(p + by) - from.grey.at<float>(p)));
    ++count;
  }
  return 2 * count >= points.size() ? std::optional<float>(sum / static_cast<float>(count))
                                    : std::nullopt;
}

// The displacement that explains best what changes, of those within `reach` of another along
// either axis.
std::optional<cv::Point> guess(const DriftPicture& from, const DriftPicture& to,
                               const cv::Point& near, int reach) {
  const std::vector<cv::Point> points = tellingPoints(from, to);
  if (points.size() < kFewestPoints) return std::nullopt;
  const int side = 2 * reach + 1;
  const cv::Point first = near - cv::Point(reach, reach);
  std::vector<std::optional<float>> misses(static_cast<std::size_t>(side) * side);
#pragma omp parallel for schedule(dynamic, 4)
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i)
      misses[static_cast<std::size_t>(j) * side + i] =
          missAt(from, to, points, first + cv::Point(i, j));
  }
  const auto best = std::min_element(
      misses.begin(), misses.end(),
      [](const auto& a, const auto& b) { return a.value_or(kMostOff) < b.value_or(kMostOff); });
  const float at_rest = *missAt(from, to, points, {0, 0});
  if (!*best || **best > kGuessed * at_rest) return std::nullopt;
  const int index = static_cast<int>(best - misses.begin());
  return first + cv::Point(index % side, index / side);
}

// The same between whole pictures, px, within a third of their width: its cost does not grow with
// them.
std::optional<cv::Point2f> guess(const DriftPicture& from, const DriftPicture& to) {
  const int cell = std::max(kCoarse, from.grey.cols / kColumns);
  const auto way = guess(coarse(from, cell), coarse(to, cell), {0, 0}, from.grey.cols / cell / 3);
  if (!way) return std::nullopt;
  if (cell == kCoarse) return *way * kCoarse;
  const auto finer =
      guess(coarse(from, kCoarse), coarse(to, kCoarse), *way * cell / kCoarse, cell / kCoarse + 1);
  return finer ? std::optional<cv::Point2f>(*finer * kCoarse) : std::nullopt;
}

// Displacement of `to` against `from` near a guess (Lucas & Kanade 1981, robust).
// @param only CV_8UC1, != 0: what counts of `from`; empty: all that is free
cv::Point2f refine(const DriftPicture& from, const DriftPicture& to, const cv::Mat& only,
                   cv::Point2f by) {
  const cv::Point2f start = by;
  struct Sums {
    Eigen::Matrix2d H = Eigen::Matrix2d::Zero();
    Eigen::Vector2d b = Eigen::Vector2d::Zero();
  };
  std::vector<Sums> of_row(from.grey.rows);
  for (int round = 0; round < kRounds; ++round) {
#pragma omp parallel for schedule(dynamic, 8)
    for (int v = 1; v < from.grey.rows - 1; v += kStride) {
      auto& [H, b] = of_row[v] = Sums();
      for (int u = 1; u + 1 < from.grey.cols; u += kStride) {
        if (!isFree(from, u, v) || (!only.empty() && only.at<std::uint8_t>(v, u) == 0)) continue;
        const float x = static_cast<float>(u) + by.x, y = static_cast<float>(v) + by.y;
        const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
        if (!isFree(to, i, j) || !isFree(to, i + 1, j + 1)) continue;
        const float fx = x - static_cast<float>(i), fy = y - static_cast<float>(j);
        const float *above = to.grey.ptr<float>(j) + i, *below = to.grey.ptr<float>(j + 1) + i;
        const float there = (1.0f - fy) * (above[0] + fx * (above[1] - above[0])) +
                            fy * (below[0] + fx * (below[1] - below[0]));
        const float off = there - from.grey.at<float>(v, u);
        const Eigen::Vector2d slope(
            0.5 * (from.grey.at<float>(v, u + 1) - from.grey.at<float>(v, u - 1)),
            0.5 * (from.grey.at<float>(v + 1, u) - from.grey.at<float>(v - 1, u)));
        const double root = 1.0 / (1.0 + off * off / (kOutlier * kOutlier));
        H += root * root * slope * slope.transpose(), b += root * root * off * slope;
      }
    }
    Sums all;
    for (const Sums& row : of_row) all.H += row.H, all.b += row.b;
    const Eigen::Vector2d step = (all.H + 1e-6 * Eigen::Matrix2d::Identity()).ldlt().solve(all.b);
    if (!(step.norm() < kFarStep)) return start;  // too little is seen of both
    by -= cv::Point2f(static_cast<float>(step.x()), static_cast<float>(step.y()));
    if (step.norm() < 0.002) break;
  }
  return by;
}

// How far the picture has come in every frame. Frames are registered to a reference: the first one,
// and whenever less than two thirds of the picture are shared with it, the frame before.
// @param expected of a frame, from those before it
template <typename Expected>
std::vector<cv::Point2f> registered(const std::vector<DriftPicture>& pictures, const cv::Mat& where,
                                    const Expected& expected) {
  std::vector<cv::Point2f> shifts(pictures.size());
  std::size_t from = 0;
  for (std::size_t i = 1; i < pictures.size(); ++i) {
    const cv::Point2f at = expected(i, shifts);
    if (std::abs(at.x - shifts[from].x) > static_cast<float>(pictures[i].grey.cols) / 3.0f ||
        std::abs(at.y - shifts[from].y) > static_cast<float>(pictures[i].grey.rows) / 3.0f)
      from = i - 1;
    shifts[i] = shifts[from] + refine(pictures[from], pictures[i], where, at - shifts[from]);
  }
  return shifts;
}

std::vector<cv::Point2f> followed(const std::vector<DriftPicture>& pictures,
                                  const cv::Point2f& pace, const cv::Mat& where) {
  return registered(pictures, where, [&](std::size_t i, const std::vector<cv::Point2f>& shifts) {
    return i == 1 ? pace : shifts[i - 1] + (shifts[i - 1] - shifts[i - 2]);
  });
}

// Where the first picture comes nearer to the second one by a displacement than at rest. CV_8UC1
cv::Mat explainedBy(const DriftPicture& from, const DriftPicture& to, const cv::Point2f& way) {
  const cv::Size size = from.grey.size(), around(kJudged, kJudged);
  cv::Mat resting, drifting, hidden;
  cv::absdiff(from.grey, to.grey, resting);
  cv::absdiff(from.grey, displaced(to.grey, way, size), drifting);
  to.covered.convertTo(hidden, CV_32F);
  hidden = (displaced(hidden, way, size) > 0.0f) | from.covered | to.covered;
  resting.setTo(0.0f, hidden), drifting.setTo(0.0f, hidden);
  cv::boxFilter(resting, resting, -1, around), cv::boxFilter(drifting, drifting, -1, around);
  return (drifting < kGuessed * resting) & ~hidden;
}

Drift driftNear(const std::vector<DriftPicture>& pictures, const cv::Point2f& pace,
                const cv::Mat& only, const cv::Mat& ground) {
  Drift drift{followed(pictures, pace, only), {}};
  drift.where = whereDrifting(pictures, drift.shifts, ground);
  return drift;
}

// What is covered shows farther in them, as they are smoothed.
std::vector<DriftPicture> picturesOf(const std::vector<ClipFrame>& frames,
                                     const std::vector<cv::Mat>& covered, int times) {
  std::vector<DriftPicture> pictures(frames.size());
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t i = 0; i < frames.size(); ++i) {
    DriftPicture& picture = pictures[i];
    cv::dilate(times == 1 ? covered[i] : cv::Mat(reducedMeans(covered[i] != 0, times) > 0),
               picture.covered, cv::Mat::ones(7, 7, CV_8U));
    cv::cvtColor(reducedMeans(frames[i].bgr, times), picture.grey, cv::COLOR_BGR2GRAY);
    picture.grey.convertTo(picture.grey, CV_32F);
    cv::GaussianBlur(picture.grey, picture.grey, {}, 1.0);
  }
  return pictures;
}

cv::Mat offBorders(const cv::Mat& where, int px) {
  cv::Mat within;
  cv::erode(where, within, cv::Mat::ones(2 * px + 1, 2 * px + 1, CV_8U));
  return within;
}

Drift driftOf(const std::vector<DriftPicture>& pictures, const cv::Mat& ground) {
  // The longest time over which a guess succeeds says best how fast it is.
  for (std::size_t last = pictures.size() - 1; last > 0; last /= 2) {
    const auto way = guess(pictures.front(), pictures[last]);
    if (!way) continue;
    const cv::Point2f pace = *way / static_cast<float>(last);
    Drift drift = driftNear(pictures, pace, cv::Mat(), ground);
    if (drift.where.empty()) {  // most of the picture may rest
      const cv::Mat explained = explainedBy(pictures.front(), pictures[last], *way);
      drift = driftNear(pictures, pace, explained, ground);
    }
    if (drift.where.empty()) return {};
    drift.shifts = followed(pictures, pace, offBorders(drift.where, kOff));
    const cv::Point2f whole = drift.shifts.back();
    return std::hypot(whole.x, whole.y) >= kLeastWay ? drift : Drift();
  }
  return {};
}

}  // namespace

cv::Mat displaced(const cv::Mat& image, const cv::Point2f& by, const cv::Size& out) {
  const int left = static_cast<int>(std::floor(by.x)), top = static_cast<int>(std::floor(by.y));
  const auto taps = [](float t) {
    return cv::Vec4f(((2.0f - t) * t - 1.0f) * t, (3.0f * t - 5.0f) * t * t + 2.0f,
                     ((4.0f - 3.0f * t) * t + 1.0f) * t, (t - 1.0f) * t * t) *
           0.5f;
  };
  // The pixels that are read: one before and two behind each.
  const cv::Rect wanted(left - 1, top - 1, out.width + 3, out.height + 3);
  const cv::Rect there = wanted & cv::Rect({0, 0}, image.size());
  if (there.empty()) return cv::Mat::zeros(out, image.type());
  cv::Mat read, moved;
  cv::copyMakeBorder(image(there), read, there.y - wanted.y, wanted.br().y - there.br().y,
                     there.x - wanted.x, wanted.br().x - there.br().x, cv::BORDER_REPLICATE);
  cv::sepFilter2D(read, moved, -1, taps(by.x - static_cast<float>(left)),
                  taps(by.y - static_cast<float>(top)), {1, 1}, 0.0, cv::BORDER_REPLICATE);
  return moved(cv::Rect({1, 1}, out)).clone();
}

Drift findDrift(const std::vector<ClipFrame>& frames, const std::vector<cv::Mat>& covered,
                const cv::Mat& ground) {
  const int times = timesTooLarge(frames.front().bgr.size());
  Drift drift = driftOf(picturesOf(frames, covered, times), reducedValues(ground, times));
  if (times == 1 || drift.where.empty()) return drift;
  const std::vector<cv::Point2f> about = drift.shifts;
  drift.where = enlargedAgain(drift.where, frames.front().bgr.size(), times, cv::INTER_NEAREST);
  drift.shifts =
      registered(picturesOf(frames, covered, 1), offBorders(drift.where, times * kOff),
                 [&](std::size_t i, const auto&) { return about[i] * static_cast<float>(times); });
  return drift;
}

}  // namespace calipso::render

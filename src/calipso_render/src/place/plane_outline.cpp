#include "place/plane_outline.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

namespace calipso::render {
namespace {

constexpr float kNear = 80.0f;        // px around what is hidden that are looked at
constexpr float kGap = 4.0f;          // px between a plane and what is seen beside it, at most half
constexpr float kOnLine = 1.2f;       // px
constexpr float kBesideLine = 10.0f;  // px within which an outline must be straight
constexpr float kLooked = 40.0f;      // ... and so far along it from what is hidden
constexpr float kStraight = 0.8f;     // part of its places there that lie on the line
constexpr int kTrials = 200;
constexpr std::size_t kJudges = 400;  // places by which a trial is judged
constexpr std::size_t kFewest = 24;   // places on a line
constexpr float kShortest = 20.0f;    // px that are seen of one
constexpr float kEnters = 10.0f;      // px from what is hidden, at most, where it was seen last
constexpr float kWrongSide = 3.0f;    // px beyond a line at which the plane must not be seen,
constexpr double kMostWrong = 0.03;   // but for so much of it
// px around what is hidden in which nothing farther may be seen on the plane's side
constexpr float kNextTo = 15.0f;
constexpr int kMostLines = 4;

// A line, unit normal towards the plane: n . p >= c on its side.
struct OutlineLine {
  cv::Point2f n;
  float c;
  float at(const cv::Point2f& p) const { return n.dot(p) - c; }
};

OutlineLine through(const cv::Point2f& a, const cv::Point2f& b) {
  const cv::Point2f way = b - a;
  const cv::Point2f n = cv::Point2f(-way.y, way.x) / static_cast<float>(cv::norm(way));
  return {n, n.dot(a)};
}

OutlineLine fitted(const std::vector<cv::Point2f>& points) {
  cv::Vec4f line;
  cv::fitLine(points, line, cv::DIST_L2, 0, 0.01, 0.01);
  return through({line[2], line[3]}, {line[2] + line[0], line[3] + line[1]});
}

class OutlineFinder {
 public:
  OutlineFinder(const cv::Mat& on, const cv::Mat& to_on, const cv::Mat& to_absent,
                const cv::Mat& hidden)
      : on_(on) {
    cv::distanceTransform(hidden == 0, to_hidden_, cv::DIST_L2, cv::DIST_MASK_5);
    for (int v = 0; v < hidden.rows; ++v) {
      for (int u = 0; u < hidden.cols; ++u) {
        const float away = to_hidden_.at<float>(v, u);
        if (away > 1.0f && away < kNear && to_on.at<float>(v, u) <= kGap &&
            std::abs(to_on.at<float>(v, u) - to_absent.at<float>(v, u)) <= 1.0f)
          points_.push_back({static_cast<float>(u), static_cast<float>(v)});
      }
    }
  }

  std::vector<OutlineLine> run() {
    std::vector<OutlineLine> lines;
    cv::RNG random(1);
    std::vector<cv::Point2f> left = points_;
    for (int i = 0; i < 2 * kMostLines && lines.size() < kMostLines; ++i) {
      const auto line = best(left, random);
      if (!line) break;
      if (const auto outline = accepted(*line)) lines.push_back(*outline);
      left.erase(std::remove_if(
                     left.begin(), left.end(),
                     [&](const cv::Point2f& p) { return std::abs(line->at(p)) <= 2.0f * kOnLine; }),
                 left.end());
    }
    return lines;
  }

  // CV_32FC1, px.
  const cv::Mat& toHidden() const { return to_hidden_; }

 private:
  static std::vector<cv::Point2f> onLine(const OutlineLine& line,
                                         const std::vector<cv::Point2f>& points) {
    std::vector<cv::Point2f> on;
    std::copy_if(points.begin(), points.end(), std::back_inserter(on),
                 [&](const cv::Point2f& p) { return std::abs(line.at(p)) <= kOnLine; });
    return on;
  }

  // The line that most places lie on.
  static std::optional<OutlineLine> best(const std::vector<cv::Point2f>& points, cv::RNG& random) {
    if (points.size() < kFewest) return std::nullopt;
    const int count = static_cast<int>(points.size());
    const std::size_t step = 1 + points.size() / kJudges;
    std::size_t most = 0;
    OutlineLine first{};
    for (int i = 0; i < kTrials; ++i) {
      const cv::Point2f &a = points[random.uniform(0, count)],
                        &b = points[random.uniform(0, count)];
      if (cv::norm(b - a) < 0.5f * kShortest) continue;
      const OutlineLine line = through(a, b);
      std::size_t on = 0;
      for (std::size_t k = 0; k < points.size(); k += step)
        on += std::abs(line.at(points[k])) <= kOnLine;
      if (on > most) most = on, first = line;
    }
    for (int round = 0; round < 2 && most > 0; ++round) {
      const std::vector<cv::Point2f> on = onLine(first, points);
      if (on.size() < kFewest) return std::nullopt;
      first = fitted(on);
    }
    return most > 0 ? std::optional<OutlineLine>(first) : std::nullopt;
  }

  // Turned towards the plane, if what is seen around agrees that the plane ends there.
  std::optional<OutlineLine> accepted(OutlineLine line) const {
    const cv::Point2f along(line.n.y, -line.n.x);
    float first = 1e9f, last = -1e9f, nearest = 1e9f, enters = 0.0f;
    for (const cv::Point2f& p : points_) {
      if (std::abs(line.at(p)) > kOnLine) continue;
      const float at = along.dot(p), away = to_hidden_.at<float>(cv::Point(p));
      first = std::min(first, at), last = std::max(last, at);
      if (away < nearest) nearest = away, enters = at;
    }
    if (last - first < kShortest || nearest > kEnters) return std::nullopt;
    int on = 0, beside = 0;  // near to where it enters
    for (const cv::Point2f& p : points_) {
      const float at = along.dot(p);
      if (std::abs(line.at(p)) > kBesideLine || std::abs(at - enters) > kLooked) continue;
      if (at < first || at > last) continue;  // past a corner
      ++beside, on += std::abs(line.at(p)) <= kOnLine;
    }
    if (on < kStraight * beside) return std::nullopt;
    int sides[2] = {0, 0};  // where the plane is seen
    for (int v = 0; v < on_.rows; ++v) {
      for (int u = 0; u < on_.cols; ++u) {
        if (on_.at<std::uint8_t>(v, u) == 0 || to_hidden_.at<float>(v, u) > kNear) continue;
        const float side = line.at(cv::Point2f(static_cast<float>(u), static_cast<float>(v)));
        if (std::abs(side) > kWrongSide) ++sides[side > 0.0f];
      }
    }
    if (sides[0] > sides[1]) std::swap(sides[0], sides[1]), line = {-line.n, -line.c};
    return sides[0] <= kMostWrong * sides[1] ? std::optional<OutlineLine>(line) : std::nullopt;
  }

  const cv::Mat& on_;
  cv::Mat to_hidden_;
  std::vector<cv::Point2f> points_;
};

}  // namespace

cv::Mat withinOutlines(const cv::Mat& on, const cv::Mat& absent, const cv::Mat& to_on,
                       const cv::Mat& to_absent, const cv::Mat& hidden) {
  OutlineFinder finder(on, to_on, to_absent, hidden);
  const std::vector<OutlineLine> lines = finder.run();
  if (lines.empty()) return {};
  cv::Mat within(on.size(), CV_8U, cv::Scalar(255)), near;
  for (int v = 0; v < on.rows; ++v) {
    for (int u = 0; u < on.cols; ++u) {
      const cv::Point2f p(static_cast<float>(u), static_cast<float>(v));
      if (std::any_of(lines.begin(), lines.end(),
                      [&](const OutlineLine& line) { return line.at(p) < 0.0f; }))
        within.at<std::uint8_t>(v, u) = 0;
    }
  }
  // It may have ended within them as well.
  near = within & (finder.toHidden() < kNextTo);
  if (cv::countNonZero(near & absent) > kMostWrong * cv::countNonZero(near & on)) return {};
  return within;
}

}  // namespace calipso::render

#include "fill/stripes.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "fill/colour_trend.hpp"
#include "fill/levelled.hpp"

namespace calipso::render {
namespace {

constexpr int kShrink = 3;   // times by which the picture in which they are sought is smaller
constexpr int kSampled = 3;  // every so many px, for the light
constexpr int kDirections = 72;
constexpr double kFinest = 0.1 * CV_PI / 180.0;  // between directions, at last
constexpr int kShortest = 27;       // px, shrunk, of a line on either side to be compared
constexpr double kCompared = 0.25;  // of what is known that must lie on such lines
constexpr double kExplained = 0.3;  // of how colours vary, by the line that they lie on
constexpr double kAlike = 0.85;     // correlation of both sides' lines

struct Likeness {
  double explained = 0.0;  // of the variance, by what both sides have in common
  double correlation = 0.0;
};

// What is known on both sides of a place.
class Sides {
 public:
  Sides(const cv::Mat& flat, const cv::Point2f& middle, const cv::Mat& known)
      : reach_(flat.rows + flat.cols) {
    for (int v = 0; v < flat.rows; ++v) {
      for (int u = 0; u < flat.cols; ++u) {
        if (known.at<std::uint8_t>(v, u) == 0) continue;
        places_.push_back(cv::Point2f(u, v) - middle);
        colours_.push_back(flat.at<cv::Vec3f>(v, u));
        variance_ += colours_.back().dot(colours_.back());
      }
    }
    variance_ /= static_cast<double>(std::max<std::size_t>(1, places_.size()));
  }

  // Of the lines in a direction: their covariance is not raised by chance, as the variance of their
  // means would be.
  Likeness along(double direction) const {
    struct Line {
      cv::Vec3f sum[2];
      int count[2];
    };
    std::vector<Line> lines(2 * reach_ + 1, Line{});
    const float c = static_cast<float>(std::cos(direction)),
                s = static_cast<float>(std::sin(direction));
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const cv::Point2f& p = places_[i];
      Line& line = lines[reach_ + cvRound(c * p.y - s * p.x)];
      const int side = c * p.x + s * p.y > 0.0f;
      line.sum[side] += colours_[i], ++line.count[side];
    }
    double both = 0.0, first = 0.0, second = 0.0, compared = 0.0;
    for (const Line& line : lines) {
      if (std::min(line.count[0], line.count[1]) < kShortest) continue;
      const double weight = line.count[0] + line.count[1];
      const cv::Vec3f a = line.sum[0] / line.count[0], b = line.sum[1] / line.count[1];
      both += weight * a.dot(b), first += weight * a.dot(a), second += weight * b.dot(b);
      compared += weight;
    }
    if (compared <= kCompared * static_cast<double>(places_.size())) return {};
    return {both / std::max(compared * variance_, 1e-9),
            both / std::max(std::sqrt(first * second), 1e-9)};
  }

 private:
  int reach_;                        // px, of any place from the middle, at most
  std::vector<cv::Point2f> places_;  // from the middle
  std::vector<cv::Vec3f> colours_;
  double variance_ = 0.0;
};

// How colours change slowly, told by a sample of the pixels.
cv::Mat lightOf(const cv::Mat& image, const cv::Mat& known) {
  cv::Mat sample, known_sample, light;
  cv::resize(image, sample, {}, 1.0 / kSampled, 1.0 / kSampled, cv::INTER_NEAREST);
  cv::resize(known, known_sample, sample.size(), 0, 0, cv::INTER_NEAREST);
  cv::resize(colourTrend(sample, known_sample), light, image.size(), 0, 0, cv::INTER_LINEAR);
  return light;
}

}  // namespace

std::optional<double> stripesAcross(const cv::Mat& image, const cv::Mat& hole,
                                    const cv::Mat& known) {
  const cv::Size half(image.cols / kShrink, image.rows / kShrink);
  if (half.empty()) return std::nullopt;
  const cv::Moments m = cv::moments(hole, true);
  if (m.m00 == 0.0) return std::nullopt;
  cv::Mat small, small_known;
  cv::resize(image, small, half, 0, 0, cv::INTER_AREA);
  cv::resize(known, small_known, half, 0, 0, cv::INTER_NEAREST);
  const cv::Point2f middle(static_cast<float>(m.m10 / m.m00 / kShrink),
                           static_cast<float>(m.m01 / m.m00 / kShrink));
  small -= lightOf(small, small_known);  // it makes no stripes
  const Sides sides(levelled(small, small_known, kStripesLevel / kShrink), middle, small_known);
  double best = 0.0;
  Likeness most;
  const auto attempt = [&](const std::vector<double>& directions) {
    std::vector<Likeness> likeness(directions.size());
#pragma omp parallel for schedule(static, 1)
    for (std::size_t i = 0; i < directions.size(); ++i) likeness[i] = sides.along(directions[i]);
    for (std::size_t i = 0; i < directions.size(); ++i) {
      if (likeness[i].explained > most.explained) most = likeness[i], best = directions[i];
    }
  };
  std::vector<double> all;
  for (int i = 0; i < kDirections; ++i)
    all.push_back(CV_PI * (static_cast<double>(i) / kDirections - 0.5));
  attempt(all);
  for (double step = 0.5 * CV_PI / kDirections; step > kFinest; step /= 2.0)
    attempt({best - step, best + step});
  if (most.explained < kExplained || most.correlation < kAlike) return std::nullopt;
  return best;
}

}  // namespace calipso::render

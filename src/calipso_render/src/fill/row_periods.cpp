#include "fill/row_periods.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>

#include "fill/levelled.hpp"
#include "fill/stripes.hpp"

namespace calipso::render {
namespace {

constexpr int kShortest = 8, kLongest = 200;  // px of a period
constexpr int kRowsAround = 4;
constexpr float kOverlap = 0.25f;  // of what is known, for a shift to be judged
constexpr int kFewest = 100;       // px that are known, likewise
constexpr float kRepeats = 0.4f;   // correlation of a shift that repeats a row, and
constexpr float kDip = 0.3f;       // by how much that of a shorter one is lower
// of the highest peak's correlation: the shortest such is the period
constexpr float kAsHigh = 0.85f;
constexpr int kNear = 2;  // px between a multiple of the period and a peak

// Sums over the places of a row, by shift.
struct RowSums {
  explicit RowSums(int shifts) : product(shifts), squares(shifts), shifted(shifts), count(shifts) {}
  std::vector<float> product, squares, shifted, count;
};

// All shifts of a place at once, as they hang on nothing that another one's sum does.
RowSums sumsOf(const float* values, const float* weight, int columns, int shifts) {
  RowSums sums(shifts);
  for (int u = 0; u < columns; ++u) {
    const float a = values[u], known = weight[u];
    if (known == 0.0f) continue;
    float *product = sums.product.data(), *squares = sums.squares.data(),
          *shifted = sums.shifted.data(), *count = sums.count.data();
    for (int k = 0; k < std::min(shifts, columns - u); ++k) {
      const float b = values[u + k], both = weight[u + k];
      product[k] += a * b, squares[k] += a * a * both, shifted[k] += b * b * known;
      count[k] += known * both;
    }
  }
  return sums;
}

// Of the rows around one, up to the first shift that cannot be judged.
std::vector<float> correlations(const std::vector<RowSums>& rows, int row) {
  const int last = std::min(static_cast<int>(rows.size()) - 1, row + kRowsAround);
  std::vector<float> correlation;
  double known = 0.0;
  for (std::size_t k = 0; k < rows[row].count.size(); ++k) {
    double product = 0.0, squares = 0.0, shifted = 0.0, count = 0.0;
    for (int v = std::max(0, row - kRowsAround); v <= last; ++v) {
      product += rows[v].product[k], squares += rows[v].squares[k];
      shifted += rows[v].shifted[k], count += rows[v].count[k];
    }
    if (k == 0) known = count;
    if (known < kFewest || count < kOverlap * known) break;
    correlation.push_back(
        static_cast<float>(product / std::sqrt(std::max(1.0, squares * shifted))));
  }
  return correlation;
}

bool isPeak(const std::vector<float>& c, int k) {
  return k > 0 && k + 1 < static_cast<int>(c.size()) && c[k] >= kRepeats && c[k] > c[k - 1] &&
         c[k] >= c[k + 1];
}

// To a part of a pixel.
float vertex(const std::vector<float>& c, int k) {
  const float bend = c[k - 1] - 2.0f * c[k] + c[k + 1];
  const float off = bend < -1e-6f ? 0.5f * (c[k - 1] - c[k + 1]) / bend : 0.0f;
  return static_cast<float>(k) + std::clamp(off, -0.5f, 0.5f);
}

// By the farthest of its multiples that follow each other as peaks.
float refined(const std::vector<float>& c, float period) {
  for (int n = 2;; ++n) {
    const int about = cvRound(static_cast<float>(n) * period);
    if (about + kNear + 1 >= static_cast<int>(c.size())) return period;
    const auto first = c.begin() + about - kNear;
    const int peak = static_cast<int>(std::max_element(first, first + 2 * kNear + 1) - c.begin());
    if (!isPeak(c, peak)) return period;
    period = vertex(c, peak) / static_cast<float>(n);
  }
}

float periodOf(const std::vector<float>& c) {
  float most = 0.0f, least = 1.0f;
  std::vector<int> peaks;
  for (int k = 1; k < static_cast<int>(c.size()); ++k) {
    least = std::min(least, c[k]);
    if (k >= kShortest && isPeak(c, k) && least < c[k] - kDip)
      peaks.push_back(k), most = std::max(most, c[k]);
  }
  for (int k : peaks) {
    if (c[k] >= kAsHigh * most) return refined(c, vertex(c, k));
  }
  return 0.0f;
}

}  // namespace

std::vector<float> rowPeriods(const cv::Mat& image, const cv::Mat& known) {
  cv::Mat grey, weight;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  grey = levelled(grey, known, kStripesLevel);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < grey.rows; ++v) grey.row(v) -= cv::mean(grey.row(v), known.row(v))[0];
  grey.setTo(0.0, known == 0);
  cv::Mat(known != 0).convertTo(weight, CV_32F, 1.0 / 255.0);
  const int shifts = std::min(kLongest, image.cols / 3) + 1;
  std::vector<RowSums> rows(image.rows, RowSums(0));
#pragma omp parallel for schedule(dynamic, 4)
  for (int v = 0; v < image.rows; ++v)
    rows[v] = sumsOf(grey.ptr<float>(v), weight.ptr<float>(v), image.cols, shifts);
  std::vector<float> periods(image.rows);
#pragma omp parallel for schedule(dynamic, 4)
  for (int v = 0; v < image.rows; ++v) periods[v] = periodOf(correlations(rows, v));
  return periods;
}

}  // namespace calipso::render

#include "place/drawn_out.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

constexpr int kBlurs = 7;           // levels of blur, each twice the one before,
constexpr float kLeastBlur = 0.5f;  // px, from this one on
static_assert(kLeastBlur * (1 << (kBlurs - 1)) / 2.0f <= DrawnOut::kCoarsest);

}  // namespace

struct DrawnOut::Blurred {
  cv::Mat picture;      // CV_32FC4
  float columns, rows;  // of it, per pixel
  int first;            // row that it begins with, where it is as large

  cv::v_float32x4 at(int u, int v) const {
    if (columns == 1.0f && rows == 1.0f) return cv::v_load(picture.at<cv::Vec4f>(v - first, u).val);
    const float x = std::clamp((static_cast<float>(u) + 0.5f) * columns - 0.5f, 0.0f,
                               static_cast<float>(picture.cols - 1));
    const float y = std::clamp((static_cast<float>(v) + 0.5f) * rows - 0.5f, 0.0f,
                               static_cast<float>(picture.rows - 1));
    const int i = static_cast<int>(x), j = static_cast<int>(y),
              right = std::min(i + 1, picture.cols - 1);
    const cv::Vec4f *above = picture.ptr<cv::Vec4f>(j),
                    *below = picture.ptr<cv::Vec4f>(std::min(j + 1, picture.rows - 1));
    const auto mix = [](const cv::v_float32x4& a, const cv::v_float32x4& b, float part) {
      return a + cv::v_setall_f32(part) * (b - a);
    };
    const auto along = [&](const cv::Vec4f* row) {
      return mix(cv::v_load(row[i].val), cv::v_load(row[right].val), x - static_cast<float>(i));
    };
    return mix(along(above), along(below), y - static_cast<float>(j));
  }
};

DrawnOut::DrawnOut(const cv::Mat& spread, float across, float slope)
    : across_(across), level_(spread.size(), CV_32F), lowest_(spread.rows), highest_(spread.rows) {
#pragma omp parallel for schedule(static)
  for (int v = 0; v < spread.rows; ++v) {
    float* levels = level_.ptr<float>(v);
    for (int u = 0; u < spread.cols; ++u) {
      const float px = slope * spread.at<float>(v, u);
      levels[u] =
          std::clamp(std::log2(std::max(px, kLeastBlur) / kLeastBlur), 0.0f, kBlurs - 1.001f);
    }
    const auto [low, high] = std::minmax_element(levels, levels + spread.cols);
    lowest_[v] = static_cast<int>(*low), highest_[v] = static_cast<int>(*high);
  }
}

cv::Mat DrawnOut::operator()(const cv::Mat& values) const {
  std::vector<Blurred> levels(*std::max_element(highest_.begin(), highest_.end()) + 2);
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t k = 0; k < levels.size(); ++k) levels[k] = blurred(values, static_cast<int>(k));
  cv::Mat out(values.size(), CV_32FC4);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u) {
      const float level = level_.at<float>(v, u);
      const int k = static_cast<int>(level);
      const cv::v_float32x4 lower = levels[k].at(u, v),
                            part = cv::v_setall_f32(level - static_cast<float>(k));
      cv::v_store(out.at<cv::Vec4f>(v, u).val, lower + part * (levels[k + 1].at(u, v) - lower));
    }
  }
  return out;
}

DrawnOut::Blurred DrawnOut::blurred(const cv::Mat& values, int level) const {
  const float along = kLeastBlur * static_cast<float>(1 << level),
              beside = std::max(kLeastBlur, across_ * along);
  const int rows = std::max(1, static_cast<int>(along / 2.0f));
  int columns = 1;  // as rows a power of two: grids of different boxes coincide
  while (4.0f * static_cast<float>(columns) <= beside) columns *= 2;
  Blurred out{{}, 1.0f, 1.0f, 0};
  cv::Mat from = values;
  if (rows > 1 || columns > 1) {
    cv::copyMakeBorder(values, from, 0, (rows - values.rows % rows) % rows, 0,
                       (columns - values.cols % columns) % columns, cv::BORDER_REPLICATE);
    cv::resize(from, from, {from.cols / columns, from.rows / rows}, 0, 0, cv::INTER_AREA);
    out.columns = 1.0f / static_cast<float>(columns), out.rows = 1.0f / static_cast<float>(rows);
  } else {
    const cv::Range used = rowsAt(level);
    if (used.empty()) return out;
    from = values.rowRange(used), out.first = used.start;
  }
  cv::GaussianBlur(from, out.picture, {}, beside / columns, along / rows, cv::BORDER_REPLICATE);
  return out;
}

// The rows that need a level of blur, and those between them.
cv::Range DrawnOut::rowsAt(int level) const {
  int first = 0, last = static_cast<int>(lowest_.size());
  const auto needs = [&](int v) { return lowest_[v] <= level && highest_[v] >= level - 1; };
  while (first < last && !needs(first)) ++first;
  while (last > first && !needs(last - 1)) --last;
  return {first, last};
}

}  // namespace calipso::render

#include "place/exposure.hpp"

#include <algorithm>
#include <cmath>

#include "calipso_render/colour.hpp"
#include "place/clip_motion.hpp"

namespace calipso::render {
namespace {

constexpr int kSide = 8;           // px of the squares whose means are compared
constexpr double kSquares = 1000;  // about so many
constexpr std::size_t kFewest = 60;
constexpr float kDark = 0.02f;                      // linear; darker squares tell little
constexpr float kSame = 0.01f;                      // of the gain: what noise and grain may make
constexpr float kAgree = 0.04f, kMostAgree = 0.6f;  // to so much, so many of the squares
constexpr std::uint8_t kClipped = 250;
constexpr float kNearlyClipped = 235.0f;  // code values, from which less is known of the light

// Mean of a square in linear light; nullopt where an object is, or it is clipped or dark.
std::optional<cv::Vec3f> meanOf(const cv::Mat& bgr, const cv::Mat& labels, const cv::Rect& where) {
  const float* linear = decodeTable();
  cv::Vec3f sum;
  for (int v = where.y; v < where.br().y; ++v) {
    const cv::Vec3b* codes = bgr.ptr<cv::Vec3b>(v);
    const std::uint8_t* label = labels.ptr<std::uint8_t>(v);
    for (int u = where.x; u < where.br().x; ++u) {
      if (label[u] != 0) return std::nullopt;
      for (int c = 0; c < 3; ++c) {
        if (codes[u][c] >= kClipped) return std::nullopt;
        sum[c] += linear[codes[u][c]];
      }
    }
  }
  sum *= 1.0f / static_cast<float>(where.area());
  if (std::min({sum[0], sum[1], sum[2]}) < kDark) return std::nullopt;
  return sum;
}

float medianOf(std::vector<float> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

ExposureMeter::ExposureMeter(const cv::Mat& key, const cv::Mat& labels) {
  const double share = static_cast<double>(key.total()) / kSquares;
  const int step = std::max(kSide, static_cast<int>(std::sqrt(share)));
  for (int v = 0; v + kSide <= key.rows; v += step) {
    for (int u = 0; u + kSide <= key.cols; u += step) {
      const cv::Rect where(u, v, kSide, kSide);
      if (const auto mean = meanOf(key, labels, where)) squares_.push_back({where, *mean});
    }
  }
}

std::optional<cv::Vec3f> ExposureMeter::gainOf(const cv::Mat& bgr, const cv::Mat& labels) const {
  std::vector<cv::Vec3f> ratios;
  for (const Square& square : squares_) {
    const auto mean = meanOf(bgr, labels, square.where);
    if (mean)
      ratios.emplace_back((*mean)[0] / square.mean[0], (*mean)[1] / square.mean[1],
                          (*mean)[2] / square.mean[2]);
  }
  if (ratios.size() < kFewest) return std::nullopt;
  cv::Vec3f gain;
  float most = 0.0f;
  for (int c = 0; c < 3; ++c) {
    std::vector<float> all;
    for (const cv::Vec3f& r : ratios) all.push_back(r[c]);
    gain[c] = medianOf(std::move(all)), most = std::max(most, std::abs(gain[c] - 1.0f));
  }
  if (most < kSame) return std::nullopt;
  const auto agrees = [&](const cv::Vec3f& r) {
    for (int c = 0; c < 3; ++c) {
      if (std::abs(r[c] - gain[c]) > kAgree * gain[c]) return false;
    }
    return true;
  };
  const auto count = std::count_if(ratios.begin(), ratios.end(), agrees);
  if (static_cast<float>(count) < kMostAgree * static_cast<float>(ratios.size()))
    return std::nullopt;
  return gain;
}

cv::Mat exposedBy(const cv::Mat& bgr, const cv::Vec3f& gain) {
  cv::Mat table(1, 256, CV_8UC3), out;
  for (int code = 0; code < 256; ++code) {
    for (int c = 0; c < 3; ++c)
      table.at<cv::Vec3b>(0, code)[c] = quantise(codeFromLinear(gain[c] * decodeTable()[code]));
  }
  cv::LUT(bgr, table, out);
  return out;
}

cv::Mat exposedAsKey(const cv::Mat& bgr, const cv::Vec3f& gain) {
  cv::Mat table(1, 256, CV_8UC3), out;
  for (int code = 0; code < 256; ++code) {
    const float clipped = std::clamp(
        (static_cast<float>(code) - kNearlyClipped) / (255.0f - kNearlyClipped), 0.0f, 1.0f);
    for (int c = 0; c < 3; ++c) {
      const float known = gain[c] > 1.0f ? 1.0f - clipped : 1.0f;
      const float back = 1.0f + known * (1.0f / gain[c] - 1.0f);
      table.at<cv::Vec3b>(0, code)[c] = quantise(codeFromLinear(back * decodeTable()[code]));
    }
  }
  cv::LUT(bgr, table, out);
  return out;
}

std::optional<ClipSample> evenlyExposed(const ClipSample& clip) {
  if (cameraMoves(clip)) return std::nullopt;
  const std::vector<ClipFrame>& frames = clip.frames();
  const ExposureMeter meter(frames.front().bgr, frames.front().labels);
  std::optional<ClipSample> even;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const auto gain = meter.gainOf(frames[i].bgr, frames[i].labels);
    if (!gain) continue;
    if (!even) even = clip;
    even->setPicture(i, exposedAsKey(frames[i].bgr, *gain));
  }
  return even;
}

}  // namespace calipso::render

#include "frame/edge_blur.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr int kAcross = 4, kAlong = 2;  // px of an outline that are looked at around a place
constexpr int kStride = 3;              // places on an outline
constexpr float kContrast = 0.05f;      // linear: the least that tells
constexpr float kMisfit = 0.1f;         // of the contrast, r.m.s.: more is no plain step
constexpr float kFurthest = 1.5f;       // px between the mask's outline and the picture's
constexpr std::size_t kFewest = 12;     // places
constexpr float kUsual = 0.3f;  // px: what lenses and pixels that overlap do; for want of places
// quantiles of the places' widths, and how much softer the one may be than the other
constexpr double kQuantile = 0.25, kSharp = 0.1;
constexpr float kSofter = 1.5f;
constexpr float kBeside = 2.5f;      // px from an outline: colours are those of what lies there
constexpr float kPixel = 0.288675f;  // standard deviation of a pixel's own width, px
constexpr float kFinest = 1.15f;     // factor between the widths that are tried
constexpr float kWidest = 3.0f;      // px

struct Sample {
  float across, value;  // px outwards; from 0 to 1
  cv::Point at;
};

// How high a blurred step is so many times its width beyond its middle, from 0 to 1: by a table, as
// places ask for it ten thousand times each.
double stepAt(double beyond) {
  constexpr int kEntries = 4096, kMiddle = kEntries / 2;
  constexpr double kPerWidth = 256.0;
  static const std::vector<double> table = [] {
    std::vector<double> heights;
    for (int i = 0; i <= kEntries; ++i)
      heights.push_back(0.5 * std::erfc((kMiddle - i) / (kPerWidth * M_SQRT2)));
    return heights;
  }();
  const double at = std::clamp(kMiddle + kPerWidth * beyond, 0.0, kEntries - 1e-9);
  const int before = static_cast<int>(at);
  return table[before] + (at - before) * (table[before + 1] - table[before]);
}

// R.m.s. of what a step at `edge`, `width` wide, leaves of the samples, over its height.
float misfit(const std::vector<Sample>& samples, float edge, float width) {
  // Least squares for value = a + b s(across), s from 0 to 1.
  double n = 0, s1 = 0, s2 = 0, v1 = 0, v2 = 0, sv = 0;
  for (const Sample& p : samples) {
    const double s = stepAt((p.across - edge) / width);
    ++n, s1 += s, s2 += s * s, v1 += p.value, v2 += p.value * p.value, sv += s * p.value;
  }
  const double spread = s2 - s1 * s1 / n, slope = spread > 0.0 ? (sv - s1 * v1 / n) / spread : 0.0;
  if (std::abs(slope) < kContrast) return std::numeric_limits<float>::max();
  const double left = v2 - v1 * v1 / n - slope * (sv - s1 * v1 / n);
  return static_cast<float>(std::sqrt(std::max(left, 0.0) / n) / std::abs(slope));
}

std::optional<float> widthOf(const std::vector<Sample>& samples) {
  float best = kMisfit, width = 0.0f;
  for (float edge = -kFurthest; edge <= kFurthest; edge += 0.25f) {
    for (float tried = kPixel; tried < kWidest; tried *= kFinest) {
      const float left = misfit(samples, edge, tried);
      if (left < best) best = left, width = tried;
    }
  }
  return width > 0.0f ? std::make_optional(width) : std::nullopt;
}

// Linear.
float brightnessAt(const cv::Mat& picture, const cv::Point& p) {
  const cv::Vec3f& code = picture.at<cv::Vec3f>(p);
  return luminance(
      {linearFromRealCode(code[0]), linearFromRealCode(code[1]), linearFromRealCode(code[2])});
}

// A colour beside its brightness, code values.
cv::Vec3f hueAt(const cv::Mat& picture, const cv::Point& p) {
  const cv::Vec3f& code = picture.at<cv::Vec3f>(p);
  return code - cv::Vec3f::all(lumaOf(code));
}

// What lies along an outline makes it look softer, never sharper. @param widths sorted
float blurOf(const std::vector<float>& widths) {
  const auto blurAt = [&](double part) {
    const float width = widths[static_cast<std::size_t>(part * widths.size())];
    return std::sqrt(std::max(width * width - kPixel * kPixel, 0.0f));
  };
  return std::min(blurAt(kQuantile), std::max(kUsual, kSofter * blurAt(kSharp)));
}

class Outlines {
 public:
  explicit Outlines(const cv::Mat& labels) : labels_(labels) {
    cv::Mat mask = labels != 0;
    mask.convertTo(mask, CV_32F, 1.0 / 255.0);
    cv::GaussianBlur(mask, mask, {0, 0}, 2.0);
    cv::Sobel(mask, along_u_, CV_32F, 1, 0), cv::Sobel(mask, along_v_, CV_32F, 0, 1);
  }

  // Sorted. @param valuesOf sets the values of the samples around a place
  template <class Values>
  std::vector<float> widths(const Values& valuesOf) const {
    std::vector<std::vector<cv::Point>> outlines;
    cv::findContours(labels_ != 0, outlines, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
    std::vector<cv::Point> places;
    for (const auto& outline : outlines)
      for (std::size_t i = 0; i < outline.size(); i += kStride) places.push_back(outline[i]);
    std::vector<std::optional<float>> widths(places.size());
#pragma omp parallel for schedule(dynamic, 8)
    for (std::size_t i = 0; i < places.size(); ++i) {
      std::vector<Sample> samples = samplesAt(places[i]);
      valuesOf(samples);
      widths[i] = widthOf(samples);
    }
    std::vector<float> found;
    for (const std::optional<float>& width : widths)
      if (width) found.push_back(*width);
    std::sort(found.begin(), found.end());
    return found;
  }

 private:
  // Pixels around a place of the outline; none close to the picture's border.
  std::vector<Sample> samplesAt(const cv::Point& place) const {
    constexpr int kReach = kAcross + kAlong;
    const cv::Rect around(place.x - kReach, place.y - kReach, 2 * kReach + 1, 2 * kReach + 1);
    const Eigen::Vector2f normal(-along_u_.at<float>(place), -along_v_.at<float>(place));
    std::vector<Sample> samples;
    if ((around & cv::Rect({0, 0}, labels_.size())) != around || normal.norm() < 1e-3f)
      return samples;
    const Eigen::Vector2f n = normal.normalized();
    for (int v = around.y; v < around.br().y; ++v) {
      for (int u = around.x; u < around.br().x; ++u) {
        const Eigen::Vector2f off(static_cast<float>(u - place.x), static_cast<float>(v - place.y));
        const float across = n.dot(off), along = n.x() * off.y() - n.y() * off.x();
        if (std::abs(across) > kAcross || std::abs(along) > kAlong) continue;
        samples.push_back({across, 0.0f, {u, v}});
      }
    }
    return samples;
  }

  const cv::Mat& labels_;
  cv::Mat along_u_, along_v_;  // CV_32FC1: gradient of the blurred mask
};

}  // namespace

float outlineBlur(const cv::Mat& picture, const cv::Mat& labels) {
  const std::vector<float> widths = Outlines(labels).widths([&](std::vector<Sample>& samples) {
    for (Sample& s : samples) s.value = brightnessAt(picture, s.at);
  });
  return widths.size() < kFewest ? kUsual : blurOf(widths);
}

float colourBlur(const cv::Mat& picture, const cv::Mat& labels) {
  const std::vector<float> widths = Outlines(labels).widths([&](std::vector<Sample>& samples) {
    cv::Vec3f change;  // from inside to outside
    for (const Sample& s : samples) {
      if (std::abs(s.across) > kBeside)
        change += std::copysign(1.0f, s.across) * hueAt(picture, s.at);
    }
    const auto length = static_cast<float>(cv::norm(change));
    for (Sample& s : samples)
      s.value = length > 0.0f ? hueAt(picture, s.at).dot(change) / (255.0f * length) : 0.0f;
  });
  return widths.size() < kFewest ? 0.0f : blurOf(widths);
}

}  // namespace calipso::render

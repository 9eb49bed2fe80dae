#include "place/place_samples.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "calipso_render/colour.hpp"
#include "place/key_cover.hpp"

namespace calipso::render {
namespace {

constexpr float kNearMedian = 6.0f;    // code values; farther ones do not enter the mean
constexpr float kLit = 0.75f;          // quantile of brightness that stands for the unshaded value
constexpr std::size_t kFewestLit = 3;  // samples that a lit or shaded group must have
constexpr double kGroupGap = 4.0;      // gap between two groups, in spreads of either
// part that a shadow takes off the channel that darkens most, against the one that darkens least:
// sun and sky have other colours, but white and blue differ by more
constexpr float kShadowTint = 2.5f;
constexpr float kTintNoise = 0.05f;  // and added to it

int brightness(const cv::Vec3b& c) { return c[0] + 2 * c[1] + c[2]; }

// Equally bright ones as they were.
Samples byBrightness(const Samples& values) {
  std::vector<std::uint32_t> keys;
  keys.reserve(values.size());
  for (std::uint32_t i = 0; i < values.size(); ++i)
    keys.push_back(static_cast<std::uint32_t>(brightness(values[i])) << 20 | i);
  std::sort(keys.begin(), keys.end());
  Samples sorted;
  sorted.reserve(values.size());
  for (const std::uint32_t key : keys) sorted.push_back(values[key & 0xfffff]);
  return sorted;
}

// Where values in order of brightness fall apart best: the least sum of squares within two groups
// (Otsu).
std::size_t bestSplit(const Samples& sorted) {
  double total = 0.0, below = 0.0, best = -1.0;
  for (const cv::Vec3b& c : sorted) total += brightness(c);
  std::size_t split = 0;
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    below += brightness(sorted[i - 1]);
    const double gap = (total - below) / (sorted.size() - i) - below / i;
    const double between = gap * gap * i * (sorted.size() - i);
    if (between > best) best = between, split = i;
  }
  return split;
}

// Half the range that the middle half of a group covers, at least the camera's noise.
double groupSpread(const Samples& sorted, std::size_t from, std::size_t to) {
  const std::size_t quarter = (to - from) / 4;
  return std::max(0.5 * (brightness(sorted[to - 1 - quarter]) - brightness(sorted[from + quarter])),
                  1.0 * kNearMedian);
}

// Brightness without shade. A shadow that stays can hold most of the samples; two clear groups
// that differ as shade does tell it, however few the bright ones are.
double litBrightness(double step, const Samples& unsorted) {
  const Samples values = byBrightness(unsorted);
  const std::size_t n = values.size(), split = bestSplit(values);
  const double usual = brightness(values[static_cast<std::size_t>(kLit * (n - 1))]);
  if (split < kFewestLit || n - split < kFewestLit) return usual;
  const cv::Vec3b &shaded = values[split / 2], &lit = values[(split + n) / 2];
  const double gap = brightness(lit) - brightness(shaded);
  const double spread = std::max(groupSpread(values, 0, split), groupSpread(values, split, n));
  const bool apart = gap > std::max(step * brightness(lit), kGroupGap * spread);
  return apart && darkenedAlike(shaded, lit) ? brightness(lit) : usual;
}

// The upper median of `of(v)`, code values, over all values, by counting them: most are about the same.
template <typename Of>
int upperMedian(const Samples& values, Of of) {
  std::array<std::uint16_t, 256> count{};
  int least = 255;
  for (const cv::Vec3b& v : values) {
    const int value = of(v);
    ++count[value], least = std::min(least, value);
  }
  int median = least;
  for (std::size_t below = count[median]; below <= values.size() / 2; below += count[median])
    ++median;
  return median;
}

cv::Vec3b medianOf(const Samples& values) {
  cv::Vec3b median;
  for (int c = 0; c < 3; ++c)
    median[c] =
        static_cast<std::uint8_t>(upperMedian(values, [c](const cv::Vec3b& v) { return v[c]; }));
  return median;
}

}  // namespace

PlaceSamples::PlaceSamples(const std::vector<ClipFrame>& frames, int margin) : frames_(frames) {
  for (const ClipFrame& f : frames) covered_.push_back(grown(f.labels != 0, margin));
}

Samples PlaceSamples::at(int u, int v) const {
  Samples values;
  values.reserve(frames_.size());
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    if (shows(i, u, v)) values.push_back(frames_[i].bgr.at<cv::Vec3b>(v, u));
  }
  return values;
}

bool darkenedAlike(const cv::Vec3b& shaded, const cv::Vec3b& lit) {
  float least = 1.0f, most = 0.0f;
  for (int c = 0; c < 3; ++c) {
    const float off = 1.0f - linearFromCode(shaded[c]) / std::max(linearFromCode(lit[c]), 1e-3f);
    least = std::min(least, off), most = std::max(most, off);
  }
  return most > 0.0f && most <= kShadowTint * std::max(0.0f, least) + kTintNoise;
}

bool shadedAgainst(const Samples& lit, const Samples& values, double step) {
  const cv::Vec3b bright = medianOf(lit), dark = medianOf(values);
  const double least = std::max(step * brightness(bright), 4.0 * kNearMedian);
  return brightness(dark) < brightness(bright) - least && darkenedAlike(dark, bright);
}

bool dropShaded(double step, Samples& values) {
  const std::size_t before = values.size();
  const double lit = litBrightness(step, values);
  const double limit = lit - std::max(step * lit, 4.0 * kNearMedian);
  values.erase(std::remove_if(values.begin(), values.end(),
                              [&](const cv::Vec3b& c) { return brightness(c) < limit; }),
               values.end());
  return 2 * values.size() < before;
}

void keepBrighter(Samples& values) {
  values = byBrightness(values);
  values.erase(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(bestSplit(values)));
}

cv::Vec3f robustMean(const Samples& values, float& spread) {
  cv::Vec3f result;
  spread = 0.0f;
  for (int c = 0; c < 3; ++c) {
    const int median = upperMedian(values, [c](const cv::Vec3b& v) { return v[c]; });
    float sum = 0.0f;
    int used = 0;
    const auto deviation = [&](const cv::Vec3b& v) { return std::abs(v[c] - median); };
    for (const cv::Vec3b& v : values) {
      if (deviation(v) <= kNearMedian) sum += v[c], ++used;
    }
    spread = std::max(spread, static_cast<float>(upperMedian(values, deviation)));
    result[c] = sum / used;
  }
  return result;
}

}  // namespace calipso::render

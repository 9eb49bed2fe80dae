#include "calipso_render/noise.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "noise_mask.hpp"

namespace calipso::render {
namespace {

constexpr int kFewestSamples = 64;  // per knot; below that the neighbours decide
constexpr int kHistogram = 512;     // of absolute differences, in 1/8 code value
constexpr int kSquare = 40;         // px
constexpr std::size_t kFewestSquares = 4;
constexpr std::size_t kMostPairs = 6;
constexpr float kUsualCorrelation = 0.55f;  // of a JPEG whose hue is coded at half the size
constexpr double kLouder = 1.2;             // times the quieter squares' deviation
// from a knot to the next, at most: shot noise hardly changes in code values, read noise grows in
// the dark
constexpr float kGrowsBrighter = 1.25f, kGrowsDarker = 2.5f;

using Histogram = std::array<int, kHistogram>;

long samplesOf(const Histogram& counts) {
  return std::accumulate(counts.begin(), counts.end(), 0L);
}

// < 0: too few samples.
double medianOf(const Histogram& counts) {
  const long total = samplesOf(counts);
  if (total < kFewestSamples) return -1.0;
  long below = 0;
  for (int i = 0; i < kHistogram; ++i) {
    const int here = counts[i];
    if (2 * (below + here) >= total) return (i + (0.5 * total - below) / here) / 8.0;
    below += here;
  }
  return kHistogram / 8.0;
}

// Absolute differences by code value and square of the picture.
class Differences {
 public:
  Differences(int knots, const cv::Size& size)
      : knots_(knots),
        columns_((size.width + kSquare - 1) / kSquare),
        counts_(knots * columns_ * ((size.height + kSquare - 1) / kSquare)) {
    for (Histogram& c : counts_) c.fill(0);
  }
  void add(int u, int v, int code, double difference) {
    const int square = u / kSquare + v / kSquare * columns_, knot = (code + 16) / 32;
    ++counts_[square * knots_ + knot][std::min(kHistogram - 1, static_cast<int>(8.0 * difference))];
  }
  long samples(int knot) const { return samplesOf(all(knot)); }

  // That of all squares, but not much more than the quieter ones': what moves is no noise.
  // < 0: too few samples.
  double median(int knot) const {
    std::vector<double> medians;
    for (std::size_t i = knot; i < counts_.size(); i += knots_) {
      const double own = medianOf(counts_[i]);
      if (own >= 0.0) medians.push_back(own);
    }
    const double whole = medianOf(all(knot));
    if (medians.size() < kFewestSquares) return whole;
    const auto quiet = medians.begin() + static_cast<std::ptrdiff_t>(medians.size() / 4);
    std::nth_element(medians.begin(), quiet, medians.end());
    return std::min(whole, kLouder * *quiet);
  }

 private:
  Histogram all(int knot) const {
    Histogram sum{};
    for (std::size_t i = knot; i < counts_.size(); i += knots_)
      std::transform(sum.begin(), sum.end(), counts_[i].begin(), sum.begin(), std::plus<>());
    return sum;
  }

  int knots_, columns_;
  std::vector<Histogram> counts_;  // per square the knots'
};

// Knots without samples take the nearest one's value.
template <std::size_t N>
void fillGaps(std::array<float, N>& values) {
  std::array<float, N> filled = values;
  for (int i = 0; i < static_cast<int>(N); ++i) {
    for (int d = 0; d < static_cast<int>(N) && filled[i] < 0.0f; ++d) {
      if (i - d >= 0 && values[i - d] >= 0.0f)
        filled[i] = values[i - d];
      else if (i + d < static_cast<int>(N) && values[i + d] >= 0.0f)
        filled[i] = values[i + d];
    }
    filled[i] = std::max(filled[i], 0.0f);
  }
  values = filled;
}

// Growth from the knot with most samples on. What else differs (something that passes and has the
// only bright parts) has few.
template <std::size_t N>
void limitGrowth(int from, std::array<float, N>& values) {
  for (std::size_t i = from + 1; i < N; ++i)
    values[i] = std::min(values[i], kGrowsBrighter * values[i - 1]);
  for (int i = from - 1; i >= 0; --i) values[i] = std::min(values[i], kGrowsDarker * values[i + 1]);
}

// Black bars, burnt-out skies: what is clipped shows no noise, however much of the picture it is.
bool isClipped(int code) { return code == 0 || code == 255; }

// Consecutive pairs: their difference has twice the variance.
void addPairs(const cv::Mat& first, const cv::Mat& second, const cv::Mat& steady, int channel,
              Differences& differences) {
  for (int v = 0; v < first.rows; v += 2) {
    const cv::Vec3b *a = first.ptr<cv::Vec3b>(v), *b = second.ptr<cv::Vec3b>(v);
    const std::uint8_t* use = steady.ptr<std::uint8_t>(v);
    for (int u = 0; u < first.cols; ++u) {
      if (use[u] == 0) continue;
      const int x = a[u][channel], y = b[u][channel];
      if (isClipped(x) || isClipped(y)) continue;
      // Spread within the cell of rounding, so that small deviations are not lost in steps of one.
      const double dither = ((u * 7 + v * 13) % 16 + 0.5) / 16.0 - 0.5;
      differences.add(u, v, (x + y) / 2, std::abs(x - y + dither) / std::sqrt(2.0));
    }
  }
}

void addDetail(const cv::Mat& frame, int channel, Differences& differences) {
  cv::Mat plane, detail;
  cv::extractChannel(frame, plane, channel);
  cv::filter2D(plane, detail, CV_32F, noiseMask());
  for (int v = 1; v + 1 < frame.rows; ++v) {
    for (int u = 1; u + 1 < frame.cols; ++u) {
      const int code = plane.at<std::uint8_t>(v, u);
      if (!isClipped(code))
        differences.add(u, v, code, std::abs(detail.at<float>(v, u)) / kNoiseMaskGain);
    }
  }
}

bool isGrey(const cv::Mat& picture) {
  std::vector<cv::Mat> channels;
  cv::split(picture, channels);
  return cv::norm(channels[0], channels[1], cv::NORM_INF) == 0.0 &&
         cv::norm(channels[1], channels[2], cv::NORM_INF) == 0.0;
}

// How alike the channels' noise is in pairs of pictures.
class CommonNoise {
 public:
  explicit CommonNoise(const NoiseModel& model) : model_(model) {}

  void add(const cv::Mat& first, const cv::Mat& second, const cv::Mat& steady) {
    for (int v = 0; v < first.rows; v += 2) {
      const cv::Vec3b *a = first.ptr<cv::Vec3b>(v), *b = second.ptr<cv::Vec3b>(v);
      const std::uint8_t* use = steady.ptr<std::uint8_t>(v);
      for (int u = 0; u < first.cols; ++u) {
        if (use[u] != 0) add(a[u], b[u]);
      }
    }
  }

  // nullopt: too little is known of it.
  std::optional<float> correlation() const {
    if (count_ < kFewestSamples || !(own_ > 0.0)) return std::nullopt;
    return static_cast<float>(std::clamp(shared_ / own_, 0.0, 1.0));
  }

 private:
  void add(const cv::Vec3b& a, const cv::Vec3b& b) {
    constexpr double kLeast = 0.3, kFarthest = 3.0;  // code values; deviations, of no outlier
    double x[3];
    for (int c = 0; c < 3; ++c) {
      if (isClipped(a[c]) || isClipped(b[c])) return;
      const double deviation = model_.deviation(c, 0.5f * static_cast<float>(a[c] + b[c]));
      x[c] = (a[c] - b[c]) / (std::sqrt(2.0) * std::max(kLeast, deviation));
      if (std::abs(x[c]) > kFarthest) return;
    }
    shared_ += x[0] * x[1] + x[1] * x[2] + x[2] * x[0];
    own_ += x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
    ++count_;
  }

  const NoiseModel& model_;
  double shared_ = 0.0, own_ = 0.0;
  long count_ = 0;
};

}  // namespace

NoiseModel::NoiseModel() : correlation_(kUsualCorrelation) {
  static const auto usual = std::make_shared<const NoiseTile>(noiseTile(kUsualCorrelation));
  tile_ = usual;
  for (auto& channel : deviation_) channel.fill(0.0f);
}

NoiseModel NoiseModel::estimate(const std::vector<cv::Mat>& frames,
                                const std::vector<cv::Mat>& steady) {
  CV_Assert(!frames.empty() && frames.size() == steady.size());
  NoiseModel model;
  for (int channel = 0; channel < 3; ++channel) {
    Differences differences(kKnots, frames[0].size());
    for (std::size_t i = 0; i + 1 < frames.size() && i < kMostPairs; ++i) {
      addPairs(frames[i], frames[i + 1], steady[i] & steady[i + 1], channel, differences);
    }
    if (frames.size() == 1) addDetail(frames[0], channel, differences);
    int best = 0;
    for (int knot = 0; knot < kKnots; ++knot) {
      if (differences.samples(knot) > differences.samples(best)) best = knot;
      model.deviation_[channel][knot] =
          static_cast<float>(kMedianToSigma * differences.median(knot));
    }
    fillGaps(model.deviation_[channel]);
    limitGrowth(best, model.deviation_[channel]);
  }
  CommonNoise common(model);
  for (std::size_t i = 0; i + 1 < frames.size() && i < kMostPairs; ++i)
    common.add(frames[i], frames[i + 1], steady[i] & steady[i + 1]);
  if (const auto correlation = common.correlation()) model.correlation_ = *correlation;
  if (isGrey(frames[0])) model.correlation_ = 1.0f;
  model.tile_ = std::make_shared<const NoiseTile>(noiseTile(model.correlation_));
  return model;
}

float NoiseModel::deviation(int channel, float code) const {
  const float x = std::clamp(code, 0.0f, 255.0f) / kKnotStep;
  const int i = static_cast<int>(x);
  const auto& d = deviation_[channel];
  return d[i] + (x - i) * (d[i + 1] - d[i]);
}

}  // namespace calipso::render

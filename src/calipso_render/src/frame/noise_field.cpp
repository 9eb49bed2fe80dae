#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/noise.hpp"

namespace calipso::render {
namespace {

constexpr int kSide = NoiseField::kSide;

std::uint64_t splitMix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

cv::Mat unitVariance(cv::Mat field) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(field, mean, deviation);
  return (field - mean[0]) / deviation[0];
}

// CV_32FC1, kSide x kSide
cv::Mat white(cv::RNG& random, int side = kSide) {
  cv::Mat field(side, side, CV_32F);
  random.fill(field, cv::RNG::NORMAL, 0.0, 1.0);
  return field;
}

struct Fields {
  cv::Mat common, own[3];  // of unit variance
};

const Fields& fields() {
  static const Fields made = [] {
    cv::RNG random(0x5eed);
    Fields f;
    cv::Mat smooth;
    cv::GaussianBlur(white(random), smooth, {5, 5}, 0.6, 0.6, cv::BORDER_REFLECT);
    f.common = unitVariance(std::sqrt(0.5) * white(random) + smooth);
    for (cv::Mat& own : f.own) {
      cv::resize(white(random, kSide / 2), smooth, {kSide, kSide}, 0, 0, cv::INTER_LINEAR);
      own = unitVariance(smooth);
    }
    return f;
  }();
  return made;
}

}  // namespace

NoiseTile noiseTile(float correlation) {
  constexpr int kColumns = kSide + NoiseField::kWrapped;
  std::vector<float> values;
  values.reserve(3 * kSide * kColumns);
  const Fields& f = fields();
  for (const cv::Mat& own : f.own) {
    const cv::Mat channel = std::sqrt(correlation) * f.common + std::sqrt(1.0f - correlation) * own;
    for (int v = 0; v < kSide; ++v) {
      for (int u = 0; u < kColumns; ++u) values.push_back(channel.at<float>(v, u % kSide));
    }
  }
  return values;
}

NoiseField::NoiseField(const NoiseModel& model, std::int64_t stamp_ns) : tile_(model.tile()) {
  const std::uint64_t h = splitMix(static_cast<std::uint64_t>(stamp_ns));
  shift_u_ = static_cast<int>(h & (kSide - 1));
  shift_v_ = static_cast<int>((h >> 20) & (kSide - 1));
}

}  // namespace calipso::render

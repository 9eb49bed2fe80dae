#include "place/lifted_shade.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_render/colour.hpp"
#include "place/key_cover.hpp"
#include "place/masked_quantile.hpp"

namespace calipso::render {
namespace {

// visible parts of the sun that count as all and none of it
constexpr float kFullSun = 0.985f, kNoSun = 0.02f;
constexpr float kHides = 0.7f;       // B
constexpr float kOpenSky = 0.5f;     // less of it is seen along contacts, where B is uncertain
constexpr double kSmooth = 2.0;      // px over which the sky's coarse directions are evened out
constexpr float kDark = 2e-3f;       // linear; added before the logarithm
constexpr float kLittle = 1.0f / 3;  // of what is seen of a plane: so much of it must be unshaded
constexpr std::size_t kFewest = 60;  // pairs
constexpr float kAlike = 0.1f;       // of the ratio: pairs that agree,
constexpr float kMostlyAlike = 1.0f / 3;  // and the part of them that must
// U: with more of the light there is no shadow; less of it has too much noise to be lifted
constexpr float kMostUmbra = 0.95f, kLeastUmbra = 0.25f;
constexpr int kNarrow = 7;      // px of what is too small to be lifted by itself
constexpr double kGrain = 1.5;  // px: what differs from the mean of so many is grain, or texture,
constexpr int kGrainSide = 5;   // ... as strong as in the mean of such a square
constexpr int kAround = 40;     // px around a piece of shade in which grain is usual
constexpr int kFewestAround = 200;

// How far inside the shadow's core, in px; negative outside.
cv::Mat depthInShade(const cv::Mat& sun) {
  cv::Mat inside, outside, depth;
  cv::distanceTransform(sun < 0.5f, inside, cv::DIST_L2, cv::DIST_MASK_5);
  cv::distanceTransform(sun >= 0.5f, outside, cv::DIST_L2, cv::DIST_MASK_5);
  cv::GaussianBlur(inside - outside, depth, {}, 1.5);
  return depth;
}

cv::Mat hiddenPart(const cv::Mat& sky) {
  cv::Mat smooth;
  cv::GaussianBlur(1.0 - sky, smooth, {}, kSmooth);
  return smooth;
}

// Mean linear colours of 3 x 3 px.
cv::Mat smoothLinear(const cv::Mat& picture) {
  cv::Mat smooth;
  cv::blur(linearFromRealCodes(picture), smooth, {3, 3});
  return smooth;
}

// Places `reach` px inside and outside of a shadow's border.
struct Pair {
  cv::Point in, out;
};

std::vector<Pair> pairsAcross(const ShadedPlace& place, int reach) {
  const cv::Mat depth = depthInShade(place.sun);
  const cv::Mat unclear = place.sunless.empty()
                              ? place.unclear
                              : cv::Mat(place.unclear | grown(place.sunless, place.margin));
  const cv::Rect all(1, 1, depth.cols - 2, depth.rows - 2);
  const auto isClear = [&](const cv::Point& p) {
    return all.contains(p) && unclear.at<std::uint8_t>(p) == 0;
  };
  std::vector<Pair> pairs;
  for (int v = 1; v + 1 < depth.rows; ++v) {
    for (int u = 1; u + 1 < depth.cols; ++u) {
      if (std::abs(depth.at<float>(v, u)) > 1.0f) continue;
      cv::Point2f inward(depth.at<float>(v, u + 1) - depth.at<float>(v, u - 1),
                         depth.at<float>(v + 1, u) - depth.at<float>(v - 1, u));
      const float length = std::hypot(inward.x, inward.y);
      if (length == 0.0f) continue;
      inward *= static_cast<float>(reach) / length;
      const cv::Point by(cvRound(inward.x), cvRound(inward.y)), in = cv::Point(u, v) + by,
                                                                out = cv::Point(u, v) - by;
      if (isClear(in) && isClear(out) && place.sun.at<float>(in) < kNoSun &&
          place.sun.at<float>(out) > kFullSun)
        pairs.push_back({in, out});
    }
  }
  return pairs;
}

// The median, if enough values lie near it.
std::optional<float> agreedOn(std::vector<float> values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  const float median = *middle;
  const auto near = std::count_if(values.begin(), values.end(),
                                  [&](float x) { return std::abs(x - median) < kAlike; });
  if (static_cast<float>(near) < kMostlyAlike * static_cast<float>(values.size()))
    return std::nullopt;
  return median;
}

// Squares of what differs from the mean around, within a mask: CV_32FC1, of all channels.
cv::Mat grainOf(const cv::Mat& picture, const cv::Mat& mask, cv::Mat& mean) {
  cv::Mat weight, inside = cv::Mat::zeros(picture.size(), CV_32FC3), energy, of;
  mask.convertTo(weight, CV_32F, 1.0 / 255.0);
  picture.copyTo(inside, mask);
  const auto smooth = [](cv::Mat& m) { cv::GaussianBlur(m, m, {}, kGrain); };
  cv::Mat total = weight.clone();
  smooth(inside), smooth(total);
  cv::merge(std::vector<cv::Mat>(3, cv::max(total, 1e-3)), of);
  mean = inside / of;
  const cv::Mat grain = picture - mean;
  cv::transform(grain.mul(grain), energy, cv::Matx13f(1, 1, 1));
  energy.setTo(0, mask == 0);
  cv::blur(energy, energy, {kGrainSide, kGrainSide}),
      cv::blur(weight, weight, {kGrainSide, kGrainSide});
  return energy / cv::max(weight, 1e-3);
}

// Noise grows when shade is taken off: what there is more of it than in the light around is taken
// off, too (Lee 1980: what spreads more than noise stays).
// @param dark CV_8UC1: where shade was taken off; open: what is seen in the light
void evenGrain(const cv::Mat& dark, const cv::Mat& open, cv::Mat& plate) {
  cv::Mat mean, unused, pieces, stats, centres;
  const cv::Mat own = grainOf(plate, dark, mean), usual = grainOf(plate, open, unused);
  const int count = cv::connectedComponentsWithStats(dark, pieces, stats, centres, 8, CV_32S);
  for (int piece = 1; piece < count; ++piece) {
    const int* of = stats.ptr<int>(piece);
    const cv::Rect box =
        cv::Rect(of[cv::CC_STAT_LEFT] - kAround, of[cv::CC_STAT_TOP] - kAround,
                 of[cv::CC_STAT_WIDTH] + 2 * kAround, of[cv::CC_STAT_HEIGHT] + 2 * kAround) &
        cv::Rect({0, 0}, dark.size());
    const cv::Mat here = pieces(box) == piece, around = grown(here, kAround) & open(box);
    if (cv::countNonZero(around) < kFewestAround) continue;
    const float grain = quantileOf(own(box), here, 0.5),
                excess = grain - quantileOf(usual(box), around, 0.5);
    if (excess <= 0.0f) continue;
    cv::Mat kept = cv::max(1.0 - excess / own(box), 1.0 - excess / grain), of_colours;
    cv::sqrt(kept, kept);
    cv::merge(std::vector<cv::Mat>(3, kept), of_colours);
    cv::Mat(mean(box) + of_colours.mul(plate(box) - mean(box))).copyTo(plate(box), here);
  }
}

}  // namespace

std::optional<cv::Vec3f> umbraAtBorders(const ShadedPlace& place, const cv::Vec3f& predicted) {
  const std::vector<Pair> pairs = pairsAcross(place, place.margin);
  if (pairs.size() < kFewest) return std::nullopt;
  const cv::Mat linear = smoothLinear(place.picture), hidden = hiddenPart(place.sky);
  cv::Vec3f umbra;
  for (int c = 0; c < 3; ++c) {
    std::vector<float> logs;
    for (const Pair& p : pairs) {
      const float in = (linear.at<cv::Vec3f>(p.in)[c] + kDark) /
                       (1.0f - kHides * hidden.at<float>(p.in)),
                  out = (linear.at<cv::Vec3f>(p.out)[c] + kDark) /
                        (1.0f - kHides * predicted[c] * hidden.at<float>(p.out));
      logs.push_back(std::log(in / out));
    }
    const std::optional<float> ratio = agreedOn(std::move(logs));
    if (!ratio) return std::nullopt;
    umbra[c] = std::exp(*ratio);
    if (umbra[c] > kMostUmbra) return std::nullopt;
  }
  return umbra;
}

cv::Mat mostlyShaded(const cv::Mat& surface, int planes, const cv::Mat& traces,
                     const cv::Mat& covered) {
  cv::Mat where = cv::Mat::zeros(traces.size(), CV_8U);
  for (int k = 1; k <= planes && !surface.empty(); ++k) {
    const cv::Mat plane = surface == k, seen = plane & (covered == 0);
    if (cv::countNonZero(seen & (traces == 0)) < kLittle * cv::countNonZero(seen))
      where.setTo(255, plane);
  }
  return where;
}

cv::Mat liftShade(const ShadedPlace& place, const cv::Mat& traces, const cv::Vec3f& predicted,
                  cv::Mat& plate) {
  const std::optional<cv::Vec3f> measured = umbraAtBorders(place, predicted);
  const cv::Vec3f umbra = measured.value_or(predicted);
  const cv::Mat clear = traces & (place.unclear == 0), hidden = hiddenPart(place.sky),
                lit = clear & (grown(place.sun < kFullSun, place.margin) == 0);
  cv::Mat dark = cv::Mat::zeros(clear.size(), CV_8U);
  if (measured && std::min({umbra[0], umbra[1], umbra[2]}) >= kLeastUmbra)
    dark = clear & (grown(place.sun > kNoSun, place.margin) == 0) & (hidden < 1.0f - kOpenSky);
  cv::morphologyEx(dark, dark, cv::MORPH_OPEN, cv::Mat::ones(kNarrow, kNarrow, CV_8U));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < clear.rows; ++v) {
    for (int u = 0; u < clear.cols; ++u) {
      const bool is_dark = dark.at<std::uint8_t>(v, u) != 0;
      if (!is_dark && lit.at<std::uint8_t>(v, u) == 0) continue;
      const bool sunless = !place.sunless.empty() && place.sunless.at<std::uint8_t>(v, u) != 0;
      const float under = 1.0f - kHides * hidden.at<float>(v, u);
      for (int c = 0; c < 3; ++c) {
        const float left = sunless ? 1.0f : umbra[c],
                    light = left * under + (is_dark ? 0.0f : 1.0f - left);
        plate.at<cv::Vec3f>(v, u)[c] =
            codeFromLinear(linearFromRealCode(place.picture.at<cv::Vec3f>(v, u)[c]) / light);
      }
    }
  }
  const cv::Mat open = (grown(place.sun < kFullSun, place.margin) == 0) & (place.unclear == 0);
  if (cv::countNonZero(dark) > 0) evenGrain(dark, open, plate);
  return lit | dark;
}

}  // namespace calipso::render

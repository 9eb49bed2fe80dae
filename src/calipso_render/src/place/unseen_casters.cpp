#include "place/unseen_casters.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_render/colour.hpp"
#include "place/masked_quantile.hpp"
#include "working_size.hpp"

namespace calipso::render {
namespace {

constexpr int kFewest = 200;                           // px of either kind
constexpr double kBlackest = 8.0, kBrightest = 250.0;  // code values between which shade shows
constexpr int kAround = 9;       // px of the square over which verdicts and brightness are averaged
constexpr float kMost = 0.25;    // part of it that must be told
constexpr double kApart = 0.35;  // log brightness between what has the sun and what has not
constexpr double kMistaken = 0.1;  // part of what was told that brightness may tell wrongly
constexpr double kBetween = 0.1;   // of the step between two tones: neither of them
// by which another surface's shade may be deeper or paler, as a part of it, and of another hue
constexpr double kOtherStep = 0.5, kOtherHue = 0.25;
constexpr double kPenumbra = 2.5;  // px, deviation, where it is not measured
constexpr int kWidest = 16;        // px on either side of a shade's border, over which it is soft
constexpr double kFewestAcross = 50;  // px at a distance from the border that tell the light there
constexpr float kFullSun = 0.9f;      // nothing is hidden
constexpr float kLeastUmbra = 1e-3f;

// Noise decides single pixels: what most around say, as they do.
cv::Mat clearly(const cv::Mat& told, std::uint8_t what, std::uint8_t other) {
  cv::Mat here, there;
  cv::boxFilter(cv::Mat(told == what), here, CV_32F, {kAround, kAround});
  cv::boxFilter(cv::Mat(told == other), there, CV_32F, {kAround, kAround});
  return (told != kSunUntold) & (here > 2.0f * there) & (here > 255.0f * kMost);
}

// Logarithm of the mean around, of what is part of `here`.
cv::Mat around(const cv::Mat& values, const cv::Mat& here) {
  cv::Mat weight, sum, weights;
  here.convertTo(weight, CV_32F, 1.0 / 255.0);
  cv::boxFilter(values.mul(weight), sum, CV_32F, {kAround, kAround});
  cv::boxFilter(weight, weights, CV_32F, {kAround, kAround});
  cv::log(sum / cv::max(weights, 1e-3) + 1e-3, sum);
  return sum;
}

// How a surface looks in the sun and out of it: logarithms of brightness, and of red to blue.
struct Tones {
  double lit, dark, lit_hue, dark_hue;
  double step() const { return lit - dark; }
  double hueStep() const { return lit_hue - dark_hue; }
};

template <typename Act>
void forEach(const cv::Mat& mask, const Act& act) {
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) {
      if (mask.at<std::uint8_t>(v, u) != 0) act(v, u);
    }
  }
}

// Hidden part of the sun, 255 all, along a way out of the shade; it does not grow.
// @param sums of linear brightness, and how many pixels they are of
std::array<std::uint8_t, 2 * kWidest> hiddenAcross(const std::array<double, 2 * kWidest>& sums,
                                                   const std::array<double, 2 * kWidest>& counts) {
  const auto mean = [&](int bin) { return sums[bin] / std::max(1.0, counts[bin]); };
  int first = 0, last = 2 * kWidest - 1;
  while (first < kWidest - 1 && counts[first] < kFewestAcross) ++first;
  while (last > kWidest && counts[last] < kFewestAcross) --last;
  const double dark = mean(first), lit = mean(last);
  std::array<std::uint8_t, 2 * kWidest> hidden{};
  double left = 1.0;
  for (int bin = 0; bin < 2 * kWidest; ++bin) {
    if (bin >= last)
      left = 0.0;
    else if (bin > first && counts[bin] > 0.0 && lit > dark)
      left = std::min(left, std::clamp((lit - mean(bin)) / (lit - dark), 0.0, 1.0));
    hidden[bin] = static_cast<std::uint8_t>(std::lround(255.0 * left));
  }
  return hidden;
}

class Surfaces {
 public:
  Surfaces(const cv::Mat& told, const cv::Mat& plate, const cv::Mat& surface)
      : surface_(surface),
        linear_(luminanceOf(linearFromRealCodes(plate))),
        dark_(clearly(told, kNoSun, kSun)),
        lit_(clearly(told, kSun, kNoSun)),
        brightness_(luminanceOf(plate)),
        shade_{{}, cv::Mat::zeros(told.size(), CV_8U)} {
    cv::GaussianBlur(dark_, shade_.hidden, {}, kPenumbra);
    cv::extractChannel(plate, blue_, 0), cv::extractChannel(plate, red_, 2);
    const cv::Mat most = cv::max(cv::max(blue_, red_), brightness_);
    clipped_ = (most > kBrightest) | (most < kBlackest);
    shade_.hidden.copyTo(hidden_clipped_, clipped_);
    dark_.setTo(0, clipped_);
  }

  CastersShade find() {
    double count = 0.0;
    if (!surface_.empty()) cv::minMaxLoc(surface_, nullptr, &count);
    std::vector<int> lit_alone;
    for (int k = 1; k <= static_cast<int>(count); ++k) {
      const cv::Mat here = surface_ == k;
      const bool darks = cv::countNonZero(here & dark_) >= kFewest,
                 lits = cv::countNonZero(here & lit_) >= kFewest;
      if (darks && lits) judgeByBoth(here);
      if (!darks && lits) lit_alone.push_back(k);
    }
    for (const int k : lit_alone) judgeByOthers(surface_ == k);
    shade_.hidden = cv::max(shade_.hidden, hidden_clipped_);
    shade_.known.setTo(0, clipped_);
    return shade_;
  }

 private:
  cv::Mat hue(const cv::Mat& here) const { return around(red_, here) - around(blue_, here); }

  // Where passing shade told of both.
  void judgeByBoth(const cv::Mat& here) {
    const cv::Mat dark_here = here & dark_, lit_here = here & lit_,
                  light = around(brightness_, here), hues = hue(here);
    const Tones tones{quantileOf(light, lit_here, 0.5), quantileOf(light, dark_here, 0.5),
                      quantileOf(hues, lit_here, 0.5), quantileOf(hues, dark_here, 0.5)};
    if (tones.step() >= kApart && take(here, light < 0.5 * (tones.lit + tones.dark)))
      others_.push_back(tones);
  }

  // Where it told of the sun alone: what is darker by as much as another surface has it, and in that
  // hue, if hardly anything is in between.
  void judgeByOthers(const cv::Mat& here) {
    const cv::Mat lit_here = here & lit_, light = around(brightness_, here), hues = hue(here);
    const double lit = quantileOf(light, lit_here, 0.5);
    for (const Tones& other : others_) {
      const double between = lit - 0.5 * other.step(), near = kBetween * other.step();
      const cv::Mat as_dark = here & (light < between),
                    neither = here & (light > between - near) & (light < between + near);
      const int darks = cv::countNonZero(as_dark);
      if (darks < kFewest || cv::countNonZero(neither) > kMistaken * cv::countNonZero(here))
        continue;
      const Tones tones{lit, quantileOf(light, as_dark, 0.5), quantileOf(hues, lit_here, 0.5),
                        quantileOf(hues, as_dark, 0.5)};
      if (std::abs(tones.step() / other.step() - 1.0) > kOtherStep ||
          std::abs(tones.hueStep() - other.hueStep()) > kOtherHue)
        continue;
      if (take(here, as_dark)) return;
    }
  }

  // Unless what was told says otherwise.
  bool take(const cv::Mat& here, const cv::Mat& as_dark) {
    const cv::Mat dark_here = here & dark_, lit_here = here & lit_;
    const int mistaken =
        cv::countNonZero(dark_here & ~as_dark) + cv::countNonZero(lit_here & as_dark);
    if (mistaken > kMistaken * (cv::countNonZero(dark_here) + cv::countNonZero(lit_here)))
      return false;
    const cv::Mat shaded = ((here & as_dark) | dark_here) & ~lit_here;
    softly(shaded, here & ~shaded).copyTo(shade_.hidden, here);
    shade_.known |= here;
    return true;
  }

  // Hidden part of the sun by the distance from the border, as the light grows across it on average.
  cv::Mat softly(const cv::Mat& shaded, const cv::Mat& open) const {
    cv::Mat in, out;
    cv::distanceTransform(~open, in, cv::DIST_L2, 5),
        cv::distanceTransform(~shaded, out, cv::DIST_L2, 5);
    const auto binOf = [&](int v, int u) {
      const bool is_open = open.at<std::uint8_t>(v, u) != 0;
      const float distance = (is_open ? out : in).at<float>(v, u);
      const int px = std::clamp(static_cast<int>(std::lround(distance)), 1, kWidest);
      return is_open ? kWidest + px - 1 : kWidest - px;
    };
    std::array<double, 2 * kWidest> sums{}, counts{};
    const cv::Mat both = shaded | open;
    forEach(both, [&](int v, int u) {
      const int bin = binOf(v, u);
      sums[bin] += linear_.at<float>(v, u), ++counts[bin];
    });
    const std::array<std::uint8_t, 2 * kWidest> hidden = hiddenAcross(sums, counts);
    cv::Mat soft = cv::Mat::zeros(both.size(), CV_8U);
    forEach(both, [&](int v, int u) { soft.at<std::uint8_t>(v, u) = hidden[binOf(v, u)]; });
    return soft;
  }

  const cv::Mat& surface_;
  cv::Mat linear_;  // luminance
  cv::Mat dark_, lit_, brightness_, blue_, red_;
  // what is clipped or black shows no shade, whatever reaches it
  cv::Mat clipped_, hidden_clipped_;
  CastersShade shade_;
  std::vector<Tones> others_;  // of surfaces where both were told
};

}  // namespace

CastersShade unseenCastersShade(const cv::Mat& told, const cv::Mat& plate, const cv::Mat& surface) {
  const int times = told.empty() ? 1 : timesTooLarge(told.size());
  if (times > 1) {
    const CastersShade shade = unseenCastersShade(
        reducedValues(told, times), reducedMeans(plate, times), reducedValues(surface, times));
    if (shade.hidden.empty()) return {};
    return {enlargedAgain(shade.hidden, told.size(), times, cv::INTER_LINEAR),
            enlargedAgain(shade.known, told.size(), times, cv::INTER_NEAREST)};
  }
  if (told.empty() || cv::countNonZero(clearly(told, kNoSun, kSun)) < kFewest) return {};
  return Surfaces(told, plate, surface).find();
}

cv::Mat hiddenOnRelief(const CastersShade& shade, const Visibility& unseen, const Relief& relief) {
  cv::Mat hidden = shade.hidden.clone();
  for (int v = 0; v < hidden.rows; ++v) {
    for (int u = 0; u < hidden.cols; ++u) {
      if (!relief.at(u, v) || shade.known.at<std::uint8_t>(v, u) != 0) continue;
      const Receiver r = relief.receiver(u, v);
      const float sun = unseen.visibility(r.position, r.normal);
      std::uint8_t& here = hidden.at<std::uint8_t>(v, u);
      if (sun < kFullSun)
        here = std::max(here, static_cast<std::uint8_t>(std::lround(255.0f * (1.0f - sun))));
    }
  }
  return hidden;
}

cv::Mat lowestSun(const cv::Mat& hidden, const cv::Mat& umbra) {
  // umbra + (1 - umbra) level = umbra / (umbra + (1 - umbra) (1 - hidden))
  cv::Mat part, left, level;
  hidden.convertTo(part, CV_32F, 1.0 / 255.0), umbra.convertTo(left, CV_32F, 1.0 / 255.0);
  left = cv::max(left, kLeastUmbra);
  cv::divide(left.mul(part), 1.0 - (1.0 - left).mul(part), level, 255.0);
  level.convertTo(level, CV_8U);
  return level;
}

}  // namespace calipso::render

#include "light/shadow_check.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

// visible part of the sun below which a pixel counts as shaded
constexpr float kSunShaded = 0.985f;
constexpr float kSkyShaded = 0.85f;  // the same for the sky: the dark line along a contact
constexpr int kMargin = 3;           // px around what says nothing: mixed pixels
// Regions are looked at in pixels of twice the size; px are those from here on.
constexpr double kScale = 3.0;           // px, deviation of the weights around a pixel
constexpr int kAround = 5;               // px around a region that are looked at
constexpr int kAlike = 8;                // px of squares over which errors are alike
constexpr int kSoft = 4;                 // px around a region that are of its prediction
constexpr int kFarthest = 4, kStep = 2;  // px by which a prediction may lie beside its shadow
constexpr int kFewest = 130;             // px of a region that is asked by itself
constexpr int kLeastOpen = 30;  // px of a region away from what says nothing, for it to be asked
constexpr double kLeastEvidence = 1.0;  // and sum of h'^2
constexpr double kByChance = 0.12;  // deviation of b where there is no shadow: what else is dark
constexpr double kDecided = 1.5;    // log of the odds from which a region is decided on by itself
constexpr float kDarkest = 0.01f;   // linear; added before the logarithm

struct Depth {
  double b, deviation, evidence;
};

cv::Mat grown(const cv::Mat& mask, int radius) {
  cv::Mat out;
  cv::dilate(mask, out,
             cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1}));
  return out;
}

cv::Mat lessSurroundings(const cv::Mat& values, const cv::Mat& weight) {
  cv::Mat sum, total;
  cv::GaussianBlur(values.mul(weight), sum, {}, kScale);
  cv::GaussianBlur(weight, total, {}, kScale);
  return (values - sum / cv::max(total, 1e-6)).mul(weight);
}

// Least squares for b; its deviation from the sums of errors over squares (cluster-robust).
Depth depthOf(const cv::Mat& h, const cv::Mat& y) {
  const double hh = h.dot(h), b = hh > 0.0 ? h.dot(y) / hh : 0.0;
  const cv::Mat error = h.mul(y - b * h);
  double squares = 0.0;
  for (int v = 0; v < error.rows; v += kAlike) {
    for (int u = 0; u < error.cols; u += kAlike) {
      const double sum =
          cv::sum(error(cv::Rect(u, v, kAlike, kAlike) & cv::Rect({0, 0}, error.size())))[0];
      squares += sum * sum;
    }
  }
  return {b, hh > 0.0 ? std::sqrt(squares) / hh : 0.0, hh};
}

cv::Mat shifted(const cv::Mat& values, const cv::Point& by) {
  cv::Mat out;
  const cv::Mat by_pixels = (cv::Mat_<double>(2, 3) << 1, 0, by.x, 0, 1, by.y);
  cv::warpAffine(values, out, by_pixels, values.size(), cv::INTER_NEAREST);
  return out;
}

cv::Mat halved(const cv::Mat& values) {
  cv::Mat half;
  cv::resize(values, half, {(values.cols + 1) / 2, (values.rows + 1) / 2}, 0, 0, cv::INTER_AREA);
  return half;
}

double logNormal(double x, double mean, double variance) {
  return -0.5 * ((x - mean) * (x - mean) / variance + std::log(variance));
}

// Log of how much likelier b is of a shadow than of none.
double logOdds(const Depth& d, const UsualDarkness& usual) {
  const double variance = d.deviation * d.deviation;
  return logNormal(d.b, usual.mean, usual.deviation * usual.deviation + variance) -
         logNormal(d.b, 0.0, kByChance * kByChance + variance);
}

class Test {
 public:
  Test(const cv::Mat& picture, const cv::Mat& unknown, const UsualDarkness& usual)
      : darkness_(picture.size(), CV_32F), usual_(usual) {
    for (int v = 0; v < picture.rows; ++v) {
      for (int u = 0; u < picture.cols; ++u) {
        const cv::Vec3f& c = picture.at<cv::Vec3f>(v, u);
        const cv::Vec3f linear(linearFromRealCode(c[0]), linearFromRealCode(c[1]),
                               linearFromRealCode(c[2]));
        darkness_.at<float>(v, u) = -std::log(luminance(linear) + kDarkest);
      }
    }
    darkness_ = halved(darkness_);
    cv::Mat(halved(grown(unknown, kMargin)) == 0).convertTo(weight_, CV_32F, 1.0 / 255.0);
  }

  // Log of the odds that a shadow is there; 0: cannot be told. @param region CV_8UC1; hidden
  // CV_32FC1
  double of(const cv::Mat& region, const cv::Mat& hidden) const {
    const int reach = kAround + kFarthest + 1;
    cv::Rect box = cv::boundingRect(region);
    box = cv::Rect(box.x / 2 - reach, box.y / 2 - reach, box.width / 2 + 2 * reach,
                   box.height / 2 + 2 * reach) &
          cv::Rect({0, 0}, darkness_.size());
    const cv::Mat part = cv::Mat(halved(region) > 0)(box);
    cv::Mat open;
    cv::erode(weight_(box) > 0.0f, open,
              cv::Mat::ones(2 * kFarthest + 1, 2 * kFarthest + 1, CV_8U));
    if (cv::countNonZero(part & open) < kLeastOpen) return 0.0;
    cv::Mat own = cv::Mat::zeros(box.size(), CV_32F), weight = own.clone();
    halved(hidden)(box).copyTo(own, grown(part, kSoft));
    weight_(box).copyTo(weight, grown(part, kAround + kFarthest));
    const cv::Mat y = lessSurroundings(darkness_(box), weight);
    const Depth depth = depthOf(bestPlace(own, weight, y), y);
    return depth.evidence >= kLeastEvidence ? logOdds(depth, usual_) : 0.0;
  }

 private:
  // h' where the prediction explains most.
  static cv::Mat bestPlace(const cv::Mat& hidden, const cv::Mat& weight, const cv::Mat& y) {
    cv::Mat best;
    double most = 0.0;
    for (int dv = -kFarthest; dv <= kFarthest; dv += kStep) {
      for (int du = -kFarthest; du <= kFarthest; du += kStep) {
        const cv::Mat h = lessSurroundings(shifted(hidden, {du, dv}), weight);
        const double hh = h.dot(h), explained = hh > 0.0 ? h.dot(y) / std::sqrt(hh) : 0.0;
        if (best.empty() || explained > most) most = explained, best = h;
      }
    }
    return best;
  }

  cv::Mat darkness_, weight_;  // of half the picture's size
  UsualDarkness usual_;
};

struct Region {
  cv::Mat mask;  // CV_8UC1
  bool of_sun;
  bool scattered;  // all small regions together
  double odds;     // log
};

void addRegions(const Test& test, const cv::Mat& visible, float limit, bool of_sun,
                std::vector<Region>& regions) {
  cv::Mat parts, extents, middles;
  const int count =
      cv::connectedComponentsWithStats(visible < limit, parts, extents, middles, 8, CV_32S);
  const cv::Mat hidden = 1.0 - visible;
  cv::Mat small = cv::Mat::zeros(visible.size(), CV_8U);
  const auto isSmall = [&](int part) { return extents.at<int>(part, cv::CC_STAT_AREA) < kFewest; };
  for (int v = 0; v < parts.rows; ++v) {
    for (int u = 0; u < parts.cols; ++u) {
      const int part = parts.at<int>(v, u);
      if (part > 0 && isSmall(part)) small.at<std::uint8_t>(v, u) = 255;
    }
  }
  for (int part = 1; part < count; ++part) {
    if (isSmall(part)) continue;
    const cv::Mat mask = parts == part;
    regions.push_back({mask, of_sun, false, test.of(mask, hidden)});
  }
  if (cv::countNonZero(small) > 0) regions.push_back({small, of_sun, true, test.of(small, hidden)});
}

}  // namespace

cv::Mat isShaded(const cv::Mat& sun, const cv::Mat& sky) {
  return (sun < kSunShaded) | (sky < kSkyShaded);
}

SeenShadows seenShadows(const cv::Mat& sun, const cv::Mat& sky, const cv::Mat& picture,
                        const cv::Mat& unknown, const UsualDarkness& usual, bool sun_is_sure) {
  const Test test(picture, unknown, usual);
  std::vector<Region> regions;
  addRegions(test, sun, kSunShaded, true, regions);
  addRegions(test, sky, kSkyShaded, false, regions);
  double all = 0.0, of_sun = 0.0;
  for (const Region& r : regions) all += r.odds, of_sun += r.of_sun ? r.odds : 0.0;
  // What cannot be decided by itself goes with all the others; the sun's, of which nothing is told,
  // unless these surely speak against it.
  const auto believed = [&](const Region& r) {
    if (std::abs(r.odds) > kDecided) return r.odds > 0.0;
    if (r.of_sun && of_sun == 0.0) return all > -kDecided;
    if (r.of_sun && !sun_is_sure) return of_sun > kDecided;
    return all >= 0.0;
  };
  const cv::Mat nothing = cv::Mat::zeros(picture.size(), CV_8U);
  SeenShadows result{nothing.clone(), nothing.clone(), nothing.clone()};
  bool any_of_sun = false;
  for (const Region& r : regions) {
    any_of_sun = any_of_sun || r.of_sun;
    if (believed(r))
      (r.of_sun ? result.sun : result.sky) |= r.mask;
    else if (r.of_sun || !r.scattered)  // specks of a little less sky tell nothing
      result.refuted |= r.mask;
  }
  result.none = !regions.empty() && cv::countNonZero(result.sun | result.sky) == 0;
  result.no_sun = any_of_sun && cv::countNonZero(result.sun) == 0;
  return result;
}

cv::Mat surelyDarker(const cv::Mat& sky, const cv::Mat& picture, const cv::Mat& unknown) {
  std::vector<Region> regions;
  addRegions(Test(picture, unknown, kOnGround), sky, kSkyShaded, false, regions);
  cv::Mat darker = cv::Mat::zeros(picture.size(), CV_8U);
  for (const Region& r : regions) {
    if (r.odds > kDecided) darker |= r.mask;
  }
  return darker;
}

}  // namespace calipso::render

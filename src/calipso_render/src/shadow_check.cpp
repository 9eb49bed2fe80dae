#include "shadow_check.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr float kSunShaded = 0.985f;    // visible part of the sun below which a pixel counts as shaded
constexpr float kSkyShaded = 0.85f;     // the same for the sky: the dark line along a contact
constexpr int kMargin = 3;              // px around what says nothing: mixed pixels
// Regions are looked at in pixels of twice the size; px are those from here on.
constexpr double kFine = 3.0, kCoarse = 6.0;  // px, deviations of the weights around a pixel
constexpr double kReach = 1.5;          // of them, around a region that is looked at
constexpr int kAlike = 8;               // px of squares over which errors are alike
constexpr int kSoft = 4;                // px around a region that are of its prediction
constexpr int kFarthest = 4, kStep = 2;  // px by which a prediction may lie beside its shadow
constexpr double kLeastEvidence = 4.0;  // sum of h'^2 from which a region is asked
constexpr double kLeastDark = 0.2;      // -log of brightness that a shadow takes away, at least
constexpr double kSurelyDark = 0.1;     // the same from which darkness is certain
constexpr double kEdgeShare = 0.5;      // of the coarse b that the fine one has, at least
constexpr int kFewest = 130;            // px of a region that is asked by itself
constexpr float kDarkest = 0.01f;       // linear; added before the logarithm

enum class Verdict { kSeen, kUnseen, kOpen };

struct Depth {
  double b, deviation, evidence;
};

cv::Mat grown(const cv::Mat& mask, int radius) {
  cv::Mat out;
  cv::dilate(mask, out, cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1}));
  return out;
}

cv::Mat lessSurroundings(const cv::Mat& values, const cv::Mat& weight, double scale) {
  cv::Mat sum, total;
  cv::GaussianBlur(values.mul(weight), sum, {}, scale);
  cv::GaussianBlur(weight, total, {}, scale);
  return (values - sum / cv::max(total, 1e-6)).mul(weight);
}

// Least squares for b; its deviation from the sums of errors over squares (cluster-robust).
Depth depthOf(const cv::Mat& h, const cv::Mat& y) {
  const double hh = h.dot(h), b = hh > 0.0 ? h.dot(y) / hh : 0.0;
  const cv::Mat error = h.mul(y - b * h);
  double squares = 0.0;
  for (int v = 0; v < error.rows; v += kAlike) {
    for (int u = 0; u < error.cols; u += kAlike) {
      const double sum = cv::sum(error(cv::Rect(u, v, kAlike, kAlike) & cv::Rect({0, 0}, error.size())))[0];
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

class Test {
 public:
  Test(const cv::Mat& picture, const cv::Mat& unknown) : darkness_(picture.size(), CV_32F) {
    for (int v = 0; v < picture.rows; ++v) {
      for (int u = 0; u < picture.cols; ++u) {
        const cv::Vec3f& c = picture.at<cv::Vec3f>(v, u);
        const cv::Vec3f linear(linearFromRealCode(c[0]), linearFromRealCode(c[1]), linearFromRealCode(c[2]));
        darkness_.at<float>(v, u) = -std::log(luminance(linear) + kDarkest);
      }
    }
    darkness_ = halved(darkness_);
    cv::Mat(halved(grown(unknown, kMargin)) == 0).convertTo(weight_, CV_32F, 1.0 / 255.0);
  }

  // @param region CV_8UC1; hidden CV_32FC1
  Verdict of(const cv::Mat& region, const cv::Mat& hidden) const {
    const int reach = static_cast<int>(kReach * kCoarse) + kFarthest + 1;
    cv::Rect box = cv::boundingRect(region);
    box = cv::Rect(box.x / 2 - reach, box.y / 2 - reach, box.width / 2 + 2 * reach, box.height / 2 + 2 * reach) & cv::Rect({0, 0}, darkness_.size());
    const cv::Mat part = cv::Mat(halved(region) > 0)(box);
    cv::Mat own = cv::Mat::zeros(box.size(), CV_32F);
    halved(hidden)(box).copyTo(own, grown(part, kSoft));
    const cv::Point beside = bestPlace(part, own, box);
    const Depth fine = at(kFine, part, shifted(own, beside), box), coarse = at(kCoarse, part, shifted(own, beside), box);
    if (fine.evidence < kLeastEvidence) return Verdict::kOpen;
    const bool edged = fine.b >= kEdgeShare * coarse.b;
    if (fine.b + 2.0 * fine.deviation < kLeastDark || !edged) return Verdict::kUnseen;
    return fine.b - 2.0 * fine.deviation > kSurelyDark ? Verdict::kSeen : Verdict::kOpen;
  }

 private:
  cv::Mat weightAround(const cv::Mat& part, double scale, const cv::Rect& box) const {
    cv::Mat weight = cv::Mat::zeros(box.size(), CV_32F);
    weight_(box).copyTo(weight, grown(part, static_cast<int>(kReach * scale) + kFarthest));
    return weight;
  }

  Depth at(double scale, const cv::Mat& part, const cv::Mat& hidden, const cv::Rect& box) const {
    const cv::Mat weight = weightAround(part, scale, box);
    return depthOf(lessSurroundings(hidden, weight, scale), lessSurroundings(darkness_(box), weight, scale));
  }

  // Where the prediction explains most.
  cv::Point bestPlace(const cv::Mat& part, const cv::Mat& hidden, const cv::Rect& box) const {
    const cv::Mat weight = weightAround(part, kFine, box), y = lessSurroundings(darkness_(box), weight, kFine);
    cv::Point best;
    double most = 0.0;
    for (int dv = -kFarthest; dv <= kFarthest; dv += kStep) {
      for (int du = -kFarthest; du <= kFarthest; du += kStep) {
        const cv::Mat h = lessSurroundings(shifted(hidden, {du, dv}), weight, kFine);
        const double hh = h.dot(h), explained = hh > 0.0 ? h.dot(y) / std::sqrt(hh) : 0.0;
        if (explained > most) most = explained, best = {du, dv};
      }
    }
    return best;
  }

  cv::Mat darkness_, weight_;  // of half the picture's size
};

struct Region {
  cv::Mat mask;  // CV_8UC1
  bool of_sun;
  Verdict verdict;
};

void addRegions(const Test& test, const cv::Mat& visible, float limit, bool of_sun, std::vector<Region>& regions) {
  cv::Mat parts;
  const int count = cv::connectedComponents(visible < limit, parts, 8, CV_32S);
  const cv::Mat hidden = 1.0 - visible;
  cv::Mat small = cv::Mat::zeros(visible.size(), CV_8U);
  for (int part = 1; part < count; ++part) {
    const cv::Mat mask = parts == part;
    if (cv::countNonZero(mask) < kFewest) small |= mask;
    else regions.push_back({mask, of_sun, test.of(mask, hidden)});
  }
  if (cv::countNonZero(small) > 0) regions.push_back({small, of_sun, test.of(small, hidden)});
}

}  // namespace

SeenShadows seenShadows(const cv::Mat& sun, const cv::Mat& sky, const cv::Mat& picture, const cv::Mat& unknown) {
  const Test test(picture, unknown);
  std::vector<Region> regions;
  addRegions(test, sun, kSunShaded, true, regions);
  addRegions(test, sky, kSkyShaded, false, regions);
  int seen = 0, unseen = 0;  // px
  for (const Region& r : regions) {
    if (r.verdict == Verdict::kSeen) seen += cv::countNonZero(r.mask);
    if (r.verdict == Verdict::kUnseen) unseen += cv::countNonZero(r.mask);
  }
  const cv::Mat nothing = cv::Mat::zeros(picture.size(), CV_8U);
  SeenShadows result{nothing.clone(), nothing.clone(), nothing.clone(), unseen > 0 && seen == 0};
  // What cannot be told follows what can.
  for (const Region& r : regions) {
    const bool believed = r.verdict == Verdict::kSeen || (r.verdict == Verdict::kOpen && unseen <= seen);
    cv::Mat& of = !believed ? result.refuted : r.of_sun ? result.sun : result.sky;
    of |= r.mask;
  }
  return result;
}

}  // namespace calipso::render

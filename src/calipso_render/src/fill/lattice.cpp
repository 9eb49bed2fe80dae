#include "fill/lattice.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "draw/side_by_side.hpp"
#include "fill/distances_to.hpp"
#include "fill/levelled.hpp"
#include "place/masked_quantile.hpp"

namespace calipso::render {
namespace {

constexpr int kFarthest = 96;      // px of the shifts that are looked at
constexpr float kShortest = 5.0f;  // px of a shift
constexpr int kLevel = 6;  // px (deviation) of the mean that is taken off: light is no pattern
constexpr float kOverlap = 0.15f;       // of what is known, for a shift to be judged
constexpr float kUnjudged = -1.0f;      // stands for the correlation of the others
constexpr float kPeak = 0.3f;           // correlation of a shift that repeats the picture, and
constexpr float kContrast = 0.1f;       // by how much that of half the shift is lower
constexpr float kStrong = 0.7f;         // of the highest peak's correlation
constexpr std::size_t kMostPeaks = 32;  // the shortest
constexpr float kSine = 0.4f;           // between the two shifts, at least
constexpr float kNear = 1.5f;           // px between a multiple of the shifts and a peak
constexpr float kOff = 2.0f;      // px from a lattice's shifts, from which a peak is another one's
constexpr float kOthers = 0.93f;  // of the correlation of a lattice's shifts, that others may have
constexpr int kMultiples = 3;
constexpr int kCompared =
    7;  // px of the square in which a picture is compared with itself one shift off
constexpr float kUnlike = 2.5f;       // times the median difference, and
constexpr float kLeastUnlike = 4.0f;  // code values more, from which it is something else
constexpr float kAsLively = 0.4f;     // of the median deviation from the mean around
constexpr float kMostOf = 0.8f;       // of the shifts of a lattice that must be peaks

struct Peak {
  cv::Point2f at;
  float correlation;
};

cv::Mat patternOf(const cv::Mat& image, const cv::Mat& known) {
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  return levelled(grey, known, kLevel);
}

// Normalised correlation of a picture and itself shifted by up to kFarthest px, right or left and
// down.
class Correlation {
 public:
  Correlation(const cv::Mat& image, const cv::Mat& known) {
    cv::Mat weight;
    cv::Mat(known != 0).convertTo(weight, CV_32F, 1.0 / 255.0);
    const cv::Mat flat = patternOf(image, known);
    const cv::Size padded(cv::getOptimalDFTSize(image.cols + kFarthest),
                          cv::getOptimalDFTSize(image.rows + kFarthest));
    cv::Mat f, f2, m, product, squares, shifted, count;
    doAll(true, {[&] { f = transformed(flat, padded); },
                 [&] { f2 = transformed(flat.mul(flat), padded); },
                 [&] { m = transformed(weight, padded); }});
    doAll(true, {[&] { product = correlated(f, f); }, [&] { squares = correlated(m, f2); },
                 [&] { shifted = correlated(f2, m); }, [&] { count = correlated(m, m); }});
    const float least = kOverlap * static_cast<float>(cv::countNonZero(known));
    ncc_ = cv::Mat(kFarthest + 1, 2 * kFarthest + 1, CV_32F, cv::Scalar(kUnjudged));
    for (int v = 0; v <= kFarthest; ++v) {
      for (int u = -kFarthest; u <= kFarthest; ++u) {
        const int j = v, i = (u + padded.width) % padded.width;
        if (count.at<float>(j, i) < least) continue;
        const float scale =
            std::sqrt(std::max(squares.at<float>(j, i) * shifted.at<float>(j, i), 1e-6f));
        ncc_.at<float>(v, u + kFarthest) = product.at<float>(j, i) / scale;
      }
    }
  }

  float at(cv::Point2f x) const {
    if (x.y < 0.0f) x = -x;
    const int u = cvRound(x.x) + kFarthest, v = cvRound(x.y);
    return u >= 0 && v >= 0 && u < ncc_.cols && v < ncc_.rows ? ncc_.at<float>(v, u) : kUnjudged;
  }
  bool covers(const cv::Point2f& x) const {
    return std::abs(x.x) < kFarthest - 2 && std::abs(x.y) < kFarthest - 2;
  }

  // The highest place within kNear px, to a part of a pixel.
  std::optional<Peak> peakNear(const cv::Point2f& x) const {
    if (!covers(x)) return std::nullopt;
    cv::Point2f best = x;
    float most = kUnjudged;
    const int reach = cvCeil(kNear);
    for (int dv = -reach; dv <= reach; ++dv) {
      for (int du = -reach; du <= reach; ++du) {
        const cv::Point2f q(std::round(x.x) + du, std::round(x.y) + dv);
        if (at(q) > most) most = at(q), best = q;
      }
    }
    return refined(best);
  }

  std::vector<Peak> peaks() const {
    std::vector<Peak> found;
    for (int v = 0; v < kFarthest - 2; ++v) {
      for (int u = 2 - kFarthest; u < kFarthest - 2; ++u) {
        const cv::Point2f x(u, v);
        if ((v == 0 && u <= 0) || std::hypot(u, v) < kShortest || at(x) < kPeak) continue;
        bool highest = true;
        for (int i = 0; i < 25 && highest; ++i) {
          const cv::Point2f d(i % 5 - 2, i / 5 - 2);
          highest = i == 12 || at(x + d) < at(x) || (at(x + d) == at(x) && i < 12);
        }
        if (highest) found.push_back(refined(x));
      }
    }
    return found;
  }

 private:
  static cv::Mat transformed(const cv::Mat& x, const cv::Size& size) {
    cv::Mat padded = cv::Mat::zeros(size, CV_32F), out;
    x.copyTo(padded(cv::Rect({0, 0}, x.size())));
    cv::dft(padded, out, 0, x.rows);
    return out;
  }
  // sum over x of a(x) b(x + shift)
  static cv::Mat correlated(const cv::Mat& a, const cv::Mat& b) {
    cv::Mat spectrum, out;
    cv::mulSpectrums(b, a, spectrum, 0, true);
    cv::idft(spectrum, out, cv::DFT_SCALE | cv::DFT_REAL_OUTPUT, kFarthest + 1);
    return out;
  }
  Peak refined(const cv::Point2f& x) const {
    const float c = at(x);
    const auto vertex = [&](const cv::Point2f& d) {
      const float a = at(x - d), b = at(x + d), bend = a - 2.0f * c + b;
      return bend < -1e-6f ? std::clamp(0.5f * (a - b) / bend, -0.5f, 0.5f) : 0.0f;
    };
    return {x + cv::Point2f(vertex({1, 0}), vertex({0, 1})), c};
  }
  cv::Mat ncc_;  // CV_32FC1; row: v, column: u + kFarthest
};

// How well a pair of shifts and what they add up to repeats the picture: the worst of them. Below
// 0: not at all, or already with halves of them.
float quality(const Correlation& c, const cv::Point2f& a, const cv::Point2f& b) {
  float worst = 1.0f, half = -1.0f;
  for (const cv::Point2f& x : {a, b, a + b, a - b}) {
    if (const auto peak = c.peakNear(x)) worst = std::min(worst, peak->correlation);
  }
  for (const cv::Point2f& x : {0.5f * a, 0.5f * b, 0.5f * (a + b)}) half = std::max(half, c.at(x));
  return half < worst - kContrast ? worst : -1.0f;
}

// The shortest of the strong ones.
std::vector<Peak> candidates(std::vector<Peak> peaks) {
  float most = 0.0f;
  for (const Peak& p : peaks) most = std::max(most, p.correlation);
  const auto is_weak = [&](const Peak& p) { return p.correlation < kStrong * most; };
  peaks.erase(std::remove_if(peaks.begin(), peaks.end(), is_weak), peaks.end());
  std::stable_sort(peaks.begin(), peaks.end(),
                   [](const Peak& a, const Peak& b) { return cv::norm(a.at) < cv::norm(b.at); });
  if (peaks.size() > kMostPeaks) peaks.resize(kMostPeaks);
  return peaks;
}

// Mean correlation of the shifts of a lattice, most of which are peaks; 0 if not.
float meanOf(const Correlation& c, const Lattice& lattice) {
  float sum = 0.0f;
  int all = 0, peaks = 0;
  for (int i = -kMultiples; i <= kMultiples; ++i) {
    for (int j = -kMultiples; j <= kMultiples; ++j) {
      if (i == 0 && j == 0) continue;
      const cv::Vec2f shift = lattice.basis * cv::Vec2f(i, j);
      const auto peak = c.peakNear({shift[0], shift[1]});
      if (peak && peak->correlation > kUnjudged)
        ++all, peaks += peak->correlation >= kPeak, sum += peak->correlation;
    }
  }
  return static_cast<float>(peaks) >= kMostOf * static_cast<float>(all)
             ? sum / static_cast<float>(std::max(1, all))
             : 0.0f;
}

// The highest of the peaks that are no shifts of a lattice, to the correlation of the shift next to
// it: both fall with the way where a picture only nearly repeats itself, and along lines that many
// shifts keep.
float highestOff(const Correlation& c, const Lattice& lattice, const std::vector<Peak>& peaks) {
  float highest = 0.0f;
  for (const Peak& p : peaks) {
    const cv::Point2f next = lattice.nearest(p.at);
    if (cv::norm(next - p.at) <= kOff || cv::norm(next) < kShortest) continue;
    const auto peak = c.peakNear(next);
    if (peak && peak->correlation > 0.0f)
      highest = std::max(highest, p.correlation / peak->correlation);
  }
  return highest;
}

// Least squares over the peaks near the multiples of two shifts.
Lattice refined(const Correlation& c, const cv::Point2f& a, const cv::Point2f& b) {
  cv::Matx22f basis(a.x, b.x, a.y, b.y);
  for (int reach = 1; reach <= kMultiples; ++reach) {
    cv::Matx22f N = cv::Matx22f::zeros(), R = cv::Matx22f::zeros();
    for (int i = -reach; i <= reach; ++i) {
      for (int j = -reach; j <= reach; ++j) {
        const cv::Vec2f n(i, j), x = basis * n;
        const auto peak = i == 0 && j == 0 ? std::nullopt : c.peakNear({x[0], x[1]});
        if (!peak || peak->correlation < kPeak) continue;
        N += n * n.t(), R += cv::Vec2f(peak->at.x, peak->at.y) * n.t();
      }
    }
    if (std::abs(cv::determinant(N)) > 1e-3) basis = R * N.inv();
  }
  return {basis, basis.inv()};
}

// Mean difference from the picture one shift off, to all sides, of what is known; the mean of a
// small square.
cv::Mat differenceFromShifted(const Lattice& lattice, const cv::Mat& image, const cv::Mat& weight) {
  cv::Mat grey, sum = cv::Mat::zeros(image.size(), CV_32F), weights = sum.clone();
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  for (int k = 0; k < 4; ++k) {
    const float sign = k % 2 == 0 ? 1.0f : -1.0f;
    const cv::Matx23f M(1, 0, sign * lattice.basis(0, k / 2), 0, 1, sign * lattice.basis(1, k / 2));
    cv::Mat shifted, both, difference;
    cv::warpAffine(grey, shifted, M, grey.size());
    cv::warpAffine(weight, both, M, grey.size());
    cv::absdiff(grey, shifted, difference);
    both = both.mul(weight);
    sum += difference.mul(both), weights += both;
  }
  const cv::Size side(kCompared, kCompared);
  cv::blur(sum, sum, side), cv::blur(weights, weights, side);
  return sum / cv::max(weights, 1e-3);
}

// Whose shifts are below kFarthest.
std::optional<Lattice> shortLattice(const cv::Mat& image, const cv::Mat& known) {
  if (cv::countNonZero(known) < 4 * kFarthest * kFarthest / 9) return std::nullopt;
  const Correlation c(image, known);
  const std::vector<Peak> all = c.peaks(), peaks = candidates(all);
  float least = 1e9f;
  std::optional<Lattice> found;
  for (std::size_t i = 0; i < peaks.size(); ++i) {
    for (std::size_t j = i + 1; j < peaks.size(); ++j) {
      const cv::Point2f a = peaks[i].at, b = peaks[j].at;
      const float cell = std::abs(static_cast<float>(a.cross(b)));
      if (cell < kSine * static_cast<float>(cv::norm(a) * cv::norm(b)) || cell >= least) continue;
      if (quality(c, a, b) < kPeak) continue;
      const Lattice lattice = refined(c, a, b);
      const float mean = meanOf(c, lattice);
      if (mean < kPeak || highestOff(c, lattice, all) > kOthers) continue;
      least = cell, found = lattice;
    }
  }
  return found;
}

}  // namespace

std::optional<Lattice> findLattice(const cv::Mat& image, const cv::Mat& known, int halvings) {
  const auto found = shortLattice(image, known);
  if (found || halvings == 0) return found;
  cv::Mat half, half_known;
  cv::resize(image, half, {}, 0.5, 0.5, cv::INTER_AREA);
  cv::resize(known, half_known, half.size(), 0, 0, cv::INTER_AREA);
  const auto coarse = findLattice(half, half_known == 255, halvings - 1);
  if (!coarse) return std::nullopt;
  return Lattice{2.0f * coarse->basis, 0.5f * coarse->inverse};
}

cv::Mat repeatsBy(const Lattice& lattice, const cv::Mat& image, const cv::Mat& known,
                  const cv::Mat& sample) {
  cv::Mat weight, on;
  known.convertTo(weight, CV_32F, 1.0 / 255.0);
  const cv::Mat difference = differenceFromShifted(lattice, image, weight);
  on = known & (difference < kUnlike * quantileOf(difference, sample, 0.5) + kLeastUnlike);
  cv::morphologyEx(on, on, cv::MORPH_OPEN, cv::Mat::ones(kCompared, kCompared, CV_8U), {-1, -1}, 1,
                   cv::BORDER_REPLICATE);
  return on;
}

cv::Mat asLively(const cv::Mat& image, const cv::Mat& known, const cv::Mat& sample) {
  cv::Mat spread;
  cv::GaussianBlur(cv::abs(patternOf(image, known)), spread, {0, 0}, kLevel);
  return spread > kAsLively * quantileOf(spread, sample, 0.5);
}

cv::Mat goesOnByPattern(const cv::Mat& repeats, const cv::Mat& known, const cv::Mat& hole) {
  cv::Mat other;
  // Gaps in what is known belong to it.
  cv::morphologyEx(known, other, cv::MORPH_CLOSE, cv::Mat::ones(kCompared, kCompared, CV_8U));
  other &= (repeats == 0) & (hole == 0);
  cv::morphologyEx(other, other, cv::MORPH_OPEN, cv::Mat::ones(kCompared, kCompared, CV_8U));
  if (cv::countNonZero(other) == 0) return hole.clone();
  if (cv::countNonZero(repeats) == 0) return cv::Mat::zeros(hole.size(), CV_8U);
  const auto [to_repeats, to_other] = distancesTo(repeats, other);
  return hole & (to_repeats < to_other);
}

}  // namespace calipso::render

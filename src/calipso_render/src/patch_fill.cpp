#include "patch_fill.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "patch_levels.hpp"

namespace calipso::render {
namespace {

constexpr int kRadius = 3;  // px; patches are squares of 7
constexpr int kSide = 2 * kRadius + 1;
constexpr int kBandRows = 16;       // rows that one thread searches in order
constexpr int kFirstGuesses = 200;  // places tried for a patch of the rim
// px around the best place in which levels, and the finest, look further
constexpr int kFarthest = 16, kFinest = 2;
constexpr int kSweeps = 2;  // of a search
// part of the patches that a sweep leads elsewhere, below which no further round follows
constexpr float kSettled = 0.05f;
// times better than what continues a neighbour's copy a place beside it must be: pieces stay large
constexpr float kJump = 1.6f;
constexpr float kNearer = 2.5f;   // times that a source may be nearer or farther,
constexpr float kHorizon = 6.0f;  // or px of height by which it may miss that
// cost of one that does not, squared code values: such are taken for want of others only
constexpr float kMisplaced = 2000.0f;
constexpr float kAsNear = 1.02f;  // times that a place may be nearer than a source as near as it
constexpr float kOffLattice = 0.75f;  // px by which a copy's way may miss the lattice

cv::Point point(const cv::Vec2s& v) { return {v[0], v[1]}; }
cv::Vec2s shorts(const cv::Point& p) { return {static_cast<short>(p.x), static_cast<short>(p.y)}; }

// One level's hole: the nearest source patch of every patch that touches it, and the picture that
// they make.
class Filling {
 public:
  // @param horizon difference of nearness that does not count
  Filling(const FillLevel& level, float scale, float horizon, const Lattice* lattice,
          const InpaintParams& params)
      : image_(level.image.clone()),
        hole_(level.hole),
        nearness_(level.nearness),
        surface_(level.surface),
        has_nearness_(!nearness_.empty()),
        has_surface_(!surface_.empty()),
        scale_(scale),
        horizon_(horizon),
        lattice_(lattice),
        params_(params),
        to_(hole_.size(), CV_16SC2, cv::Scalar(-1, -1)),
        cost_(hole_.size(), CV_32F, cv::Scalar(0.0f)),
        bands_((hole_.rows + kBandRows - 1) / kBandRows) {
    const cv::Mat patch = cv::Mat::ones(kSide, kSide, CV_8U);
    cv::Mat touched;
    cv::erode(level.source, whole_, patch, {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
    cv::findNonZero(whole_, sources_);
    cv::dilate(hole_, touched, patch);
    for (int v = kRadius; v + kRadius < hole_.rows; ++v) {
      for (int u = kRadius; u + kRadius < hole_.cols; ++u) {
        if (touched.at<std::uint8_t>(v, u) != 0) bands_[v / kBandRows].emplace_back(u, v);
      }
    }
  }

  bool possible() const {
    return !sources_.empty() && std::any_of(bands_.begin(), bands_.end(),
                                            [](const auto& band) { return !band.empty(); });
  }

  // From the rim inwards: a ring's patches are compared by what is known of them, then the ring is
  // filled.
  void peel() {
    cv::Mat known = hole_ == 0, ring;
    for (;;) {
      cv::dilate(known, ring, cv::Mat::ones(3, 3, CV_8U));
      ring &= hole_ & (known == 0);
      std::vector<cv::Point> pixels;
      cv::findNonZero(ring, pixels);
      if (pixels.empty()) return;
      std::vector<Guess> guesses(pixels.size());
#pragma omp parallel for schedule(dynamic, 8)
      for (std::size_t i = 0; i < pixels.size(); ++i)
        guesses[i] = firstGuess(centreFor(pixels[i]), known);
      for (std::size_t i = 0; i < pixels.size(); ++i) spreadMatch(centreFor(pixels[i]), guesses[i]);
      for (const cv::Point& pixel : pixels) {
        const cv::Point p = centreFor(pixel);
        image_.at<cv::Vec4f>(pixel) = image_.at<cv::Vec4f>(match(p) + pixel - p);
      }
      known |= ring;
    }
  }

  // Takes over, twice as far, what half the size found. At the finest level it is copied at once:
  // means of patches would be blurred, and resemble bland places most.
  void startFrom(const Filling& coarse) {
    forEachPatch([&](const cv::Point& p) {
      const cv::Point c = coarse.centreFor({p.x / 2, p.y / 2});
      const cv::Vec2s from = coarse.to_.at<cv::Vec2s>(c);
      if (from[0] < 0) return;
      const cv::Point q = p + 2 * (point(from) - c);
      for (int i = 0; i < 9 && !hasMatch(p); ++i) {
        const cv::Point near = i == 0 ? q : q + jitter(p, i, kFinest);
        if (isWhole(near)) to_.at<cv::Vec2s>(p) = shorts(near);
      }
    });
    if (scale_ > 1.0f)
      vote();
    else
      copy();
  }

  // @param reach px around the best place found so far in which others are tried
  // @return part of the patches that were led elsewhere
  float search(int reach) {
    std::vector<int> changes(bands_.size(), 0);
    forEachPatch([&](const cv::Point& p) {
      if (!hasMatch(p)) to_.at<cv::Vec2s>(p) = shorts(anySource(p, 0));
      cost_.at<float>(p) = distance(p, match(p), 1e30f);
    });
    for (int s = 0; s < kSweeps; ++s) {
      ++sweep_;
      // Bands beside each other never at the same time: they read each other's rims.
      for (int first = 0; first < 2; ++first) {
#pragma omp parallel for schedule(dynamic, 1)
        for (int b = first; b < static_cast<int>(bands_.size()); b += 2)
          changes[b] += searchBand(bands_[b], sweep_ % 2 == 0, reach);
      }
    }
    std::size_t all = 0;
    for (const auto& band : bands_) all += band.size();
    return static_cast<float>(std::accumulate(changes.begin(), changes.end(), 0)) /
           static_cast<float>(kSweeps * all);
  }

  // Every hole pixel becomes the mean of what the patches over it have there, good ones above all.
  void vote() {
    std::vector<float> costs;
    for (const auto& band : bands_) {
      for (const cv::Point& p : band) costs.push_back(cost_.at<float>(p));
    }
    const std::size_t part = 3 * costs.size() / 4;
    std::nth_element(costs.begin(), costs.begin() + part, costs.end());
    const float scale = -0.5f / std::max(costs[part], 1.0f);
    cv::Mat weights(hole_.size(), CV_32F, cv::Scalar(0.0f)), next = image_.clone();
    forEachPatch([&](const cv::Point& p) {
      weights.at<float>(p) = hasMatch(p) ? std::exp(scale * cost_.at<float>(p)) + 1e-6f : 0.0f;
    });
#pragma omp parallel for schedule(dynamic, 4)
    for (int v = 0; v < hole_.rows; ++v) {
      for (int u = 0; u < hole_.cols; ++u) {
        if (hole_.at<std::uint8_t>(v, u) != 0) next.at<cv::Vec4f>(v, u) = meanVote({u, v}, weights);
      }
    }
    image_ = next;
  }

  // Every hole pixel becomes what the patch around it has there.
  void copy() {
    const cv::Mat from = origins();
    cv::Mat next = image_.clone();
    for (int v = 0; v < hole_.rows; ++v) {
      for (int u = 0; u < hole_.cols; ++u) {
        const cv::Vec2s q = from.at<cv::Vec2s>(v, u);
        if (q[0] >= 0) next.at<cv::Vec4f>(v, u) = image_.at<cv::Vec4f>(q[1], q[0]);
      }
    }
    image_ = next;
  }

  cv::Mat origins() const {
    cv::Mat origin(hole_.size(), CV_16SC2, cv::Scalar(-1, -1));
    for (int v = 0; v < hole_.rows; ++v) {
      for (int u = 0; u < hole_.cols; ++u) {
        if (hole_.at<std::uint8_t>(v, u) == 0) continue;
        const cv::Point p = centreFor({u, v});
        if (hasMatch(p)) origin.at<cv::Vec2s>(v, u) = shorts(match(p) + cv::Point(u, v) - p);
      }
    }
    return origin;
  }

 private:
  cv::Point match(const cv::Point& p) const { return point(to_.at<cv::Vec2s>(p)); }
  bool hasMatch(const cv::Point& p) const { return to_.at<cv::Vec2s>(p)[0] >= 0; }
  bool inside(const cv::Point& p) const {
    return p.x >= 0 && p.y >= 0 && p.x < hole_.cols && p.y < hole_.rows;
  }
  bool isWhole(const cv::Point& p) const { return inside(p) && whole_.at<std::uint8_t>(p) != 0; }
  cv::Point anySource(const cv::Point& p, int salt) const {
    return sources_[random(p, salt) % sources_.size()];
  }

  // The nearest centre of a patch that lies within the picture.
  cv::Point centreFor(const cv::Point& p) const {
    return {std::clamp(p.x, kRadius, hole_.cols - 1 - kRadius),
            std::clamp(p.y, kRadius, hole_.rows - 1 - kRadius)};
  }

  template <typename Do>
  void forEachPatch(Do act) {
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t b = 0; b < bands_.size(); ++b) {
      for (const cv::Point& p : bands_[b]) act(p);
    }
  }

  int searchBand(const std::vector<cv::Point>& band, bool backwards, int reach) {
    const int step = backwards ? 1 : -1;
    int changed = 0;
    for (std::size_t i = 0; i < band.size(); ++i) {
      const cv::Point p = band[backwards ? band.size() - 1 - i : i], before = match(p);
      for (const cv::Point& d : {cv::Point(step, 0), cv::Point(0, step)}) {
        if (inside(p + d) && hasMatch(p + d)) attempt(p, match(p + d) - d, 1.0f);
      }
      for (int r = reach; r >= 1; r /= 2) {
        const cv::Point q = match(p) + jitter(p, r, r);
        attempt(p, lattice_ == nullptr ? q : onLattice(p, q), kJump);
      }
      changed += match(p) != before;
    }
    return changed;
  }

  // @param better how many times the cost must be lower
  void attempt(const cv::Point& p, const cv::Point& q, float better) {
    if (!isWhole(q)) return;
    float& least = cost_.at<float>(p);
    const float cost = better * distance(p, q, least / better);
    if (cost < least) least = cost, to_.at<cv::Vec2s>(p) = shorts(q);
  }

  // A patch of the rim, the best place found for it and what that costs.
  struct Guess {
    std::vector<cv::Point> seen;  // what is known of it, from its middle
    cv::Point best;
    float least;
  };

  void attempt(const cv::Point& p, cv::Point q, Guess& guess) const {
    if (lattice_ != nullptr) q = onLattice(p, q);
    const float cost = isWhole(q) ? partialDistance(p, q, guess.seen, guess.least) : guess.least;
    if (cost < guess.least) guess.least = cost, guess.best = q;
  }

  // Among places all over the picture.
  Guess firstGuess(const cv::Point& p, const cv::Mat& known) const {
    Guess guess{knownAround(p, known), anySource(p, 0), 0.0f};
    guess.least = partialDistance(p, guess.best, guess.seen, 1e30f);
    for (int i = 1; i < kFirstGuesses; ++i) attempt(p, anySource(p, i), guess);
    return guess;
  }

  // Then its neighbours' and around the best.
  void spreadMatch(const cv::Point& p, Guess& guess) {
    for (int dv = -2; dv <= 2; ++dv) {
      for (int du = -2; du <= 2; ++du) {
        const cv::Point d(du, dv);
        if (inside(p + d) && hasMatch(p + d)) attempt(p, match(p + d) - d, guess);
      }
    }
    for (int reach = 8; reach >= 1; reach /= 2) {
      for (int i = 0; i < 6; ++i)
        attempt(p, guess.best + jitter(p, kFirstGuesses + 8 * i + reach, reach), guess);
    }
    to_.at<cv::Vec2s>(p) = shorts(guess.best);
  }

  // What is known of the patch around a place, from it.
  static std::vector<cv::Point> knownAround(const cv::Point& p, const cv::Mat& known) {
    std::vector<cv::Point> seen;
    for (int dv = -kRadius; dv <= kRadius; ++dv) {
      for (int du = -kRadius; du <= kRadius; ++du) {
        if (known.at<std::uint8_t>(p + cv::Point(du, dv)) != 0) seen.push_back({du, dv});
      }
    }
    return seen;
  }

  cv::Vec4f meanVote(const cv::Point& pixel, const cv::Mat& weights) const {
    cv::Vec4f sum;
    float total = 0.0f;
    for (int dv = -kRadius; dv <= kRadius; ++dv) {
      for (int du = -kRadius; du <= kRadius; ++du) {
        const cv::Point centre = pixel + cv::Point(du, dv);
        const float w = inside(centre) ? weights.at<float>(centre) : 0.0f;
        if (w > 0.0f)
          sum += w * image_.at<cv::Vec4f>(match(centre) - cv::Point(du, dv)), total += w;
      }
    }
    return total > 0.0f ? cv::Vec4f(sum / total) : image_.at<cv::Vec4f>(pixel);
  }

  // Places are layered: what is at another height is seldom the same, what is of another surface
  // never.
  float awayCost(const cv::Point& p, const cv::Point& q) const {
    float cost = scale_ * (params_.away_row * std::abs(p.y - q.y) +
                           params_.away_column * std::abs(p.x - q.x));
    if (has_nearness_) {
      const float own = nearness_.at<float>(p), other = nearness_.at<float>(q);
      if (other > kNearer * own + horizon_ || own > kNearer * other + horizon_) cost += kMisplaced;
      if (params_.away_farther > 0.0f && own > kAsNear * other && other > 0.0f)
        cost += params_.away_farther * (own / other - kAsNear);
    }
    if (has_surface_) {
      const std::uint8_t own = surface_.at<std::uint8_t>(p), other = surface_.at<std::uint8_t>(q);
      if (own != 0 && other != 0 && own != other) cost += kMisplaced;
    }
    if (lattice_ != nullptr && offLattice(q - p) > kOffLattice) cost += kMisplaced;
    return kSide * kSide * cost;
  }

  // px of this level by which a shift misses the lattice
  float offLattice(const cv::Point& shift) const {
    const cv::Point2f fine = scale_ * cv::Point2f(shift);
    return static_cast<float>(cv::norm(fine - lattice_->nearest(fine))) / scale_;
  }
  // The shift of the lattice that is nearest to the way to a place.
  cv::Point onLattice(const cv::Point& p, const cv::Point& q) const {
    const cv::Point2f whole = lattice_->nearest(scale_ * cv::Point2f(q - p));
    return p + cv::Point(cvRound(whole.x / scale_), cvRound(whole.y / scale_));
  }

  float distance(const cv::Point& p, const cv::Point& q, float bound) const {
    using Row = Eigen::Map<const Eigen::Array<float, 4 * kSide, 1>>;
    float sum = awayCost(p, q);
    for (int dv = -kRadius; dv <= kRadius && sum < bound; ++dv) {
      const Row a(image_.ptr<float>(p.y + dv) + 4 * (p.x - kRadius)),
          b(image_.ptr<float>(q.y + dv) + 4 * (q.x - kRadius));
      sum += (a - b).square().sum();
    }
    return sum;
  }

  // Of what is known. No less than `bound` if it is not below.
  float partialDistance(const cv::Point& p, const cv::Point& q, const std::vector<cv::Point>& seen,
                        float bound) const {
    using Pixel = Eigen::Map<const Eigen::Array4f>;
    const float away = awayCost(p, q),
                part = static_cast<float>(kSide * kSide) / std::max<std::size_t>(1, seen.size());
    Eigen::Array4f sums = Eigen::Array4f::Zero();
    for (std::size_t i = 0; i < seen.size(); ++i) {
      if (i % kSide == 0 && part * sums.sum() + away >= bound) return bound;
      const Eigen::Array4f difference = Pixel(image_.at<cv::Vec4f>(p + seen[i]).val) -
                                        Pixel(image_.at<cv::Vec4f>(q + seen[i]).val);
      sums += difference.square();
    }
    return part * sums.sum() + away;
  }

  cv::Point jitter(const cv::Point& p, int salt, int reach) const {
    const std::uint32_t h = random(p, 1024 + salt);
    return {static_cast<int>((h & 0xffff) % (2 * reach + 1)) - reach,
            static_cast<int>((h >> 16) % (2 * reach + 1)) - reach};
  }

  std::uint32_t random(const cv::Point& p, int salt) const {
    std::uint32_t h = params_.seed * 0x9e3779b9u ^ static_cast<std::uint32_t>(p.x) * 0x85ebca6bu ^
                      static_cast<std::uint32_t>(p.y) * 0xc2b2ae35u ^
                      static_cast<std::uint32_t>(salt + 2048 * sweep_) * 0x27d4eb2fu;
    h ^= h >> 15, h *= 0x2c1b3c6du, h ^= h >> 12, h *= 0x297a2d39u, h ^= h >> 15;
    return h;
  }

  cv::Mat image_, hole_, nearness_, surface_,
      whole_;  // whole_ CV_8UC1: all of the patch around it may be copied
  bool has_nearness_, has_surface_;
  float scale_, horizon_;   // size of these pixels in the finest level's
  const Lattice* lattice_;  // may be nullptr
  InpaintParams params_;
  cv::Mat to_, cost_;  // CV_16SC2, CV_32FC1, of the patch around every pixel
  std::vector<std::vector<cv::Point>> bands_;  // the patches, by rows
  std::vector<cv::Point> sources_;
  int sweep_ = 0;
};

// Search and vote in turn until hardly any patch is led elsewhere.
void settle(Filling& filling, int rounds, int reach) {
  for (int i = 0; i < rounds; ++i) {
    const float changed = filling.search(reach);
    filling.vote();
    if (changed < kSettled) return;
  }
}

}  // namespace

cv::Mat patchOrigins(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& source,
                     const Lattice* lattice, const InpaintParams& params) {
  const std::vector<FillLevel> levels = fillLevels(image, hole, source, params);
  const float horizon = params.nearness.empty() ? 0.0f : kHorizon * nearnessPerRow(params.nearness);
  const int coarsest = static_cast<int>(levels.size()) - 1;
  Filling filling(levels[coarsest], static_cast<float>(1 << coarsest), horizon, lattice, params);
  if (!filling.possible()) return cv::Mat(hole.size(), CV_16SC2, cv::Scalar(-1, -1));
  filling.peel();
  settle(filling, params.coarsest_rounds, std::max(hole.cols, hole.rows) >> coarsest);
  for (int k = coarsest - 1; k >= 0; --k) {
    Filling finer(levels[k], static_cast<float>(1 << k), horizon, lattice, params);
    finer.startFrom(filling);
    if (k > 0)
      settle(finer, params.rounds, kFarthest);
    else
      finer.search(kFinest);
    filling = finer;
  }
  return filling.origins();
}

}  // namespace calipso::render

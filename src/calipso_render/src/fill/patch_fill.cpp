#include "fill/patch_fill.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "fill/band_turns.hpp"
#include "fill/patch_cost.hpp"
#include "fill/patch_levels.hpp"
#include "fill/patch_sources.hpp"
#include "fill/place_random.hpp"

namespace calipso::render {
namespace {

constexpr int kBandRows = 16;  // rows that one thread searches in order
// places tried for a patch of the rim, and where more than the rim has been filled before
constexpr int kFirstGuesses = 200, kGuessesAnew = 40;
// px around the best place in which levels, and the finest, look further
constexpr int kFarthest = 16, kFinest = 2;
constexpr int kSweeps = 2;  // of a search
// part of the patches that a sweep leads elsewhere, below which no further round follows
constexpr float kSettled = 0.05f;
// times better than what continues a neighbour's copy a place beside it must be: pieces stay large
constexpr float kJump = 1.6f;
constexpr float kHorizon = 6.0f;  // px of height by which a source may miss PatchCost's limits

cv::Point point(const cv::Vec2s& v) { return {v[0], v[1]}; }
cv::Vec2s shorts(const cv::Point& p) { return {static_cast<short>(p.x), static_cast<short>(p.y)}; }

// One level's hole: the nearest source patch of every patch that touches it, and the picture that
// they make.
class Filling {
 public:
  // @param level its picture is filled
  // @param horizon difference of nearness that does not count
  Filling(const FillLevel& level, float scale, float horizon, const Pattern& pattern,
          const InpaintParams& params)
      : image_(level.image),
        hole_(level.hole),
        sources_(level.source, level.surface),
        scale_(scale),
        rules_(level, scale, horizon, pattern, params),
        striped_(pattern.striped),
        params_(params),
        random_(params.seed, std::max({hole_.cols, hole_.rows, kFarthest})),
        to_(hole_.size(), CV_16SC2, cv::Scalar(-1, -1)),
        cost_(hole_.size(), CV_32F, cv::Scalar(0.0f)),
        plain_(hole_.size(), CV_8U, cv::Scalar(0)),
        bands_((hole_.rows + kBandRows - 1) / kBandRows) {
    cv::Mat touched;
    cv::dilate(hole_, touched, cv::Mat::ones(kPatchSide, kPatchSide, CV_8U));
    for (int v = kPatchRadius; v + kPatchRadius < hole_.rows; ++v) {
      for (int u = kPatchRadius; u + kPatchRadius < hole_.cols; ++u) {
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
  void peel() { peel(hole_); }

  void peel(const cv::Mat& part) {
    cv::Mat known = part == 0, ring;
    const cv::Rect box = cv::boundingRect(part);
    for (;;) {
      cv::dilate(known(box), ring, cv::Mat::ones(3, 3, CV_8U));
      ring &= part(box) & (known(box) == 0);
      std::vector<cv::Point> pixels;
      cv::findNonZero(ring, pixels);
      if (pixels.empty()) return;
      for (cv::Point& pixel : pixels) pixel += box.tl();
      std::vector<Guess> guesses(pixels.size());
#pragma omp parallel for schedule(dynamic, 8)
      for (std::size_t i = 0; i < pixels.size(); ++i)
        guesses[i] = firstGuess(centreFor(pixels[i]), known);
      for (std::size_t i = 0; i < pixels.size(); ++i) spreadMatch(centreFor(pixels[i]), guesses[i]);
      for (const cv::Point& pixel : pixels) {
        const cv::Point p = centreFor(pixel);
        image_.at<cv::Vec4f>(pixel) = image_.at<cv::Vec4f>(match(p) + pixel - p);
      }
      known(box) |= ring;
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
        if (sources_.contains(near)) to_.at<cv::Vec2s>(p) = shorts(near);
      }
    });
    scale_ > 1.0f ? vote() : copy();
  }

  // Peels anew what was led off its surface, or nowhere: coarser levels have fewer whole patches
  // and nothing thin, and finer ones look no farther than around what those found.
  void peelMisled() {
    cv::Mat misled = cv::Mat::zeros(hole_.size(), CV_8U);
    for (int v = 0; v < hole_.rows; ++v) {
      for (int u = 0; u < hole_.cols; ++u) {
        const cv::Point p = centreFor({u, v});
        if (hole_.at<std::uint8_t>(v, u) != 0 && (!hasMatch(p) || isMisled(p)))
          misled.at<std::uint8_t>(v, u) = 255;
      }
    }
    if (cv::countNonZero(misled) == 0) return;
    along_surfaces_ = true;
    peel(misled);
    along_surfaces_ = false;
  }

  // @param reach px around the best place found so far in which others are tried
  // @return part of the patches that were led elsewhere
  float search(int reach) {
    std::vector<int> changes(bands_.size(), 0);
    cv::extractChannel(image_, lively_, 3);
    cv::blur(lively_, lively_, {kPatchSide, kPatchSide});
    forEachPatch([&](const cv::Point& p) {
      if (!hasMatch(p)) to_.at<cv::Vec2s>(p) = shorts(sources_.one(number(p, 0)));
      cost_.at<float>(p) = rules_.distance(image_, lively_, p, match(p), 1e30f);
      plain_.at<std::uint8_t>(p) = 255;
    });
    sweepBands(static_cast<int>(bands_.size()), kSweeps, [&](int b, int sweep) {
      changes[b] += searchBand(bands_[b], sweep_ + 1 + sweep, reach);
    });
    sweep_ += kSweeps;
    std::size_t all = 0;
    for (const auto& band : bands_) all += band.size();
    return static_cast<float>(std::accumulate(changes.begin(), changes.end(), 0)) /
           static_cast<float>(kSweeps * all);
  }

  // Every hole pixel becomes the mean of what the patches over it have there, good ones above all.
  // Patches come from what is no hole.
  void vote() {
    std::vector<float> costs;
    for (const auto& band : bands_) {
      for (const cv::Point& p : band) costs.push_back(cost_.at<float>(p));
    }
    const std::size_t part = 3 * costs.size() / 4;
    std::nth_element(costs.begin(), costs.begin() + part, costs.end());
    const float scale = -0.5f / std::max(costs[part], 1.0f);
    cv::Mat weights(hole_.size(), CV_32F, cv::Scalar(0.0f));
    forEachPatch([&](const cv::Point& p) {
      weights.at<float>(p) = hasMatch(p) ? std::exp(scale * cost_.at<float>(p)) + 1e-6f : 0.0f;
    });
#pragma omp parallel for schedule(dynamic, 4)
    for (int v = 0; v < hole_.rows; ++v) {
      for (int u = 0; u < hole_.cols; ++u) {
        if (hole_.at<std::uint8_t>(v, u) != 0)
          image_.at<cv::Vec4f>(v, u) = meanVote({u, v}, weights);
      }
    }
  }

  // Every hole pixel becomes what the patch around it has there.
  void copy() {
    const cv::Mat from = origins();
#pragma omp parallel for schedule(static)
    for (int v = 0; v < hole_.rows; ++v) {
      for (int u = 0; u < hole_.cols; ++u) {
        const cv::Vec2s q = from.at<cv::Vec2s>(v, u);
        if (q[0] >= 0) image_.at<cv::Vec4f>(v, u) = image_.at<cv::Vec4f>(q[1], q[0]);
      }
    }
  }

  cv::Mat origins() const {
    cv::Mat origin(hole_.size(), CV_16SC2, cv::Scalar(-1, -1));
#pragma omp parallel for schedule(static)
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
  bool inside(const cv::Point& p) const { return cv::Rect({0, 0}, hole_.size()).contains(p); }
  std::uint32_t number(const cv::Point& p, int salt) const {
    return random_.number(p, salt, sweep_);
  }
  bool isMisled(const cv::Point& p) const {
    return rules_.onOther(p, match(p)) && sources_.anyOn(rules_.surfaceAt(p));
  }

  // The nearest centre of a patch that lies within the picture.
  cv::Point centreFor(const cv::Point& p) const {
    return {std::clamp(p.x, kPatchRadius, hole_.cols - 1 - kPatchRadius),
            std::clamp(p.y, kPatchRadius, hole_.rows - 1 - kPatchRadius)};
  }

  template <typename Do>
  void forEachPatch(Do act) {
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t b = 0; b < bands_.size(); ++b) {
      for (const cv::Point& p : bands_[b]) act(p);
    }
  }

  int searchBand(const std::vector<cv::Point>& band, int sweep, int reach) {
    const bool backwards = sweep % 2 == 0;
    const int step = backwards ? 1 : -1;
    int changed = 0;
    for (std::size_t i = 0; i < band.size(); ++i) {
      const cv::Point p = band[backwards ? band.size() - 1 - i : i], before = match(p);
      for (const cv::Point& d : {cv::Point(step, 0), cv::Point(0, step)}) {
        if (inside(p + d) && hasMatch(p + d)) attempt(p, match(p + d) - d, 1.0f);
      }
      for (int r = reach; r >= 1; r /= 2) {
        const cv::Point q = match(p) + random_.offset(p, r, sweep, r);
        attempt(p, rules_.onPattern(p, q), kJump);
      }
      changed += match(p) != before;
    }
    return changed;
  }

  // @param better how many times the cost must be lower
  void attempt(const cv::Point& p, const cv::Point& q, float better) {
    if (!sources_.contains(q)) return;
    std::uint8_t& plain = plain_.at<std::uint8_t>(p);
    // Most neighbours lead to where a patch has been led already.
    if (q == match(p) && (plain != 0 || better > 1.0f)) return;
    float& least = cost_.at<float>(p);
    const float cost = better * rules_.distance(image_, lively_, p, q, least / better);
    if (cost >= least) return;
    least = cost, to_.at<cv::Vec2s>(p) = shorts(q);
    plain = better > 1.0f ? 0 : 255;
  }

  // A patch of the rim, the best place found for it and what that costs.
  struct Guess {
    std::vector<int> seen;  // what is known of it, as PatchCost counts it
    cv::Point best;
    float least;
    std::vector<cv::Point> tried;  // its neighbours mostly lead to the same few places
  };

  // Nothing that is peeled along its plane is led off it again.
  void attempt(const cv::Point& p, cv::Point q, Guess& guess) const {
    q = rules_.onPattern(p, q);
    const bool allowed = sources_.contains(q) && !(along_surfaces_ && rules_.onOtherPlane(p, q) &&
                                                   sources_.anyOn(rules_.surfaceAt(p)));
    const float cost =
        allowed ? rules_.partialDistance(image_, p, q, guess.seen, guess.least) : guess.least;
    if (cost < guess.least) guess.least = cost, guess.best = q;
  }

  // A place to copy from. What goes on in stripes is sought along them every other time.
  cv::Point somewhere(const cv::Point& p, int salt) const {
    const std::uint32_t any = number(p, salt);
    if (along_surfaces_) return sources_.oneOn(rules_.surfaceAt(p), any);
    return striped_ && salt % 2 == 1 ? sources_.oneInRow(p.y, any) : sources_.one(any);
  }

  // Among places all over the picture.
  Guess firstGuess(const cv::Point& p, const cv::Mat& known) const {
    Guess guess{knownAround(p, known, image_), somewhere(p, 0), 0.0f, {}};
    guess.least = rules_.partialDistance(image_, p, guess.best, guess.seen, 1e30f);
    const int guesses = along_surfaces_ ? kGuessesAnew : kFirstGuesses;
    for (int i = 1; i < guesses; ++i) attempt(p, somewhere(p, i), guess);
    return guess;
  }

  // Then its neighbours' and around the best.
  void spreadMatch(const cv::Point& p, Guess& guess) {
    for (int dv = -2; dv <= 2; ++dv) {
      for (int du = -2; du <= 2; ++du) {
        const cv::Point d(du, dv);
        if (!inside(p + d) || !hasMatch(p + d)) continue;
        const cv::Point q = match(p + d) - d;
        if (std::find(guess.tried.begin(), guess.tried.end(), q) != guess.tried.end()) continue;
        guess.tried.push_back(q);
        attempt(p, q, guess);
      }
    }
    for (int reach = 8; reach >= 1; reach /= 2) {
      for (int i = 0; i < 6; ++i)
        attempt(p, guess.best + jitter(p, kFirstGuesses + 8 * i + reach, reach), guess);
    }
    to_.at<cv::Vec2s>(p) = shorts(guess.best);
  }

  cv::Vec4f meanVote(const cv::Point& pixel, const cv::Mat& weights) const {
    const cv::Rect centres =
        cv::Rect(pixel.x - kPatchRadius, pixel.y - kPatchRadius, kPatchSide, kPatchSide) &
        cv::Rect({0, 0}, hole_.size());
    cv::v_float32x4 sums = cv::v_setzero_f32();
    float total = 0.0f;
    for (int v = centres.y; v < centres.br().y; ++v) {
      const float* weight = weights.ptr<float>(v);
      const cv::Vec2s* to = to_.ptr<cv::Vec2s>(v);
      for (int u = centres.x; u < centres.br().x; ++u) {
        const float w = weight[u];
        if (w <= 0.0f) continue;
        const cv::Vec4f& voted =
            image_.ptr<cv::Vec4f>(to[u][1] + pixel.y - v)[to[u][0] + pixel.x - u];
        sums += cv::v_setall_f32(w) * cv::v_load(voted.val);
        total += w;
      }
    }
    cv::Vec4f sum;
    cv::v_store(sum.val, sums);
    return total > 0.0f ? cv::Vec4f(sum / total) : image_.at<cv::Vec4f>(pixel);
  }

  cv::Point jitter(const cv::Point& p, int salt, int reach) const {
    return random_.offset(p, salt, sweep_, reach);
  }

  cv::Mat image_, hole_;
  PatchSources sources_;
  float scale_;  // size of these pixels in the finest level's
  PatchCost rules_;
  bool striped_;
  InpaintParams params_;
  PlaceRandom random_;
  cv::Mat to_, cost_;  // CV_16SC2, CV_32FC1, of the patch around every pixel
  cv::Mat lively_;     // PatchCost::distance()'s
  cv::Mat plain_;      // CV_8UC1: != 0 where cost_ is no multiple of what the match costs
  std::vector<std::vector<cv::Point>> bands_;  // the patches, by rows
  bool along_surfaces_ = false;                // a place's first guesses lie on its own surface
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
                     const Pattern& pattern, const InpaintParams& params) {
  const std::vector<FillLevel> levels = fillLevels(image, hole, source, params);
  const float horizon = params.nearness.empty() ? 0.0f : kHorizon * nearnessPerRow(params.nearness);
  const auto fillingOf = [&](int k) {
    return Filling(levels[k], static_cast<float>(1 << k), horizon, pattern, params);
  };
  const int coarsest = coarsestUseful(levels, params.from_few);
  Filling filling = fillingOf(coarsest);
  if (!filling.possible()) return cv::Mat(hole.size(), CV_16SC2, cv::Scalar(-1, -1));
  filling.peel();
  settle(filling, params.coarsest_rounds, std::max(hole.cols, hole.rows) >> coarsest);
  for (int k = coarsest - 1; k >= 0; --k) {
    Filling finer = fillingOf(k);
    finer.startFrom(filling);
    finer.peelMisled();
    if (k > 0)
      settle(finer, params.rounds, kFarthest);
    else
      finer.search(kFinest);
    filling = std::move(finer);
  }
  return filling.origins();
}

}  // namespace calipso::render

#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "calipso_flow/patch_match.hpp"
#include "calipso_flow/reference_view.hpp"

namespace calipso::flow {

// How much a match is worth: a rough one, at half size, reaches far; a forward one is precise but
// may show another surface; a checked one has been followed back.
enum class Care { kRough, kForward, kChecked };

// What makes a match count.
struct MatchTrust {
  // a match followed back misses its origin by less, beside its own uncertainty
  double forward_backward_px = 0.3;
  double largest_deviation_px = 0.5;  // a match less certain than this is dropped
  double least_correlation = 0.4;     // of the patch with its reference
};

// Patches that vary in one direction only are matched across it.
PatchParams stripePatches(PatchParams params);

// The warped look of an object and the frame it is to be found in. Immutable once made.
class LookMatch {
 public:
  // @param picture  CV_32F, the whole frame
  LookMatch(const ReferenceView::Warped& look, const cv::Mat& picture, Care care);

  Care care() const { return care_; }
  // A point of the look, and where it is expected in the frame; px of the full size.
  struct Seed {
    Eigen::Vector2d at, expected;
  };
  // Where the patch of the look around a seed is found in the frame.
  std::optional<PatchMatch> find(const Seed& seed, const PatchParams& params) const;
  // The same as far as the match is to be trusted, followed back where `care` asks for it.
  std::optional<PatchMatch> findSurely(const Seed& seed, const PatchParams& params,
                                       const MatchTrust& trust) const;
  // The search at every seed, by several threads.
  using Matches = std::vector<std::optional<PatchMatch>>;
  using Search = std::function<std::optional<PatchMatch>(const Seed& seed)>;
  static Matches forEach(const std::vector<Seed>& seeds, const Search& search);
  // Logarithm of the mean brightness around a match over that of the look around its seed; nothing
  // where the look is not known all around.
  std::optional<double> brightening(const Seed& seed, const PatchMatch& match, int radius_px) const;
  // By how much the match, followed back into the look, misses the point where it began.
  std::optional<Eigen::Vector2d> missOnReturn(const Eigen::Vector2d& at, const PatchMatch& there,
                                              const PatchParams& params) const;

 private:
  Care care_;
  double scale_;
  ImageWindow look_, weight_, frame_;
};

}  // namespace calipso::flow

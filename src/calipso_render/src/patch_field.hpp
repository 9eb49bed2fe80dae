#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// B, G, R in code values, then how much the picture varies along u and v around the pixel: without the
// latter, smooth places attract everything (Newson et al. 2014).
using Feature = cv::Vec<float, 5>;

// For one level of the pyramid: which source patch each patch that touches the hole resembles most.
class PatchField {
 public:
  // @param image CV_32FC(5) of Feature, filled somehow; hole, source: CV_8UC1 (source: whole patch may be copied)
  // @param scale size of this level's pixels in the finest level's
  PatchField(cv::Mat image, cv::Mat hole, cv::Mat source, int radius, float scale, std::uint32_t seed);

  // false: there is no source patch at this level.
  bool hasSources() const { return !sources_.empty(); }

  void initialiseRandomly();
  // Doubles a coarser level's offsets.
  void initialiseFrom(const PatchField& coarse);

  // One sweep of propagation and random search around each match, up to `reach` px away.
  void search(bool backwards, int reach);

  // New colours of the hole from the patches that overlap it: their weighted mean, or (`copy`) the one
  // source pixel closest to that mean.
  void vote(bool copy);

  const cv::Mat& image() const { return image_; }
  const cv::Mat& origin() const { return origin_; }  // CV_16SC2, of the last vote

 private:
  struct Match {
    int u = -1, v = -1;
    float distance = 0.0f;  // cost()
  };
  // Squared difference of two patches, mean per pixel, plus the cost of the way between them.
  float cost(int u, int v, int su, int sv, float limit) const;
  float squaredDistance(int u, int v, int su, int sv, float limit) const;
  bool isSource(int u, int v) const;
  void tryMatch(int u, int v, int su, int sv, Match& best) const;
  void searchRow(int v, bool backwards, int reach, const std::vector<Match>& before, int first, int last);
  Feature voteAt(int u, int v, bool copy, cv::Vec2s& origin) const;
  Match& at(int u, int v) { return matches_[static_cast<std::size_t>(v) * image_.cols + u]; }
  const Match& at(int u, int v) const { return matches_[static_cast<std::size_t>(v) * image_.cols + u]; }
  std::uint32_t random(int u, int v, int salt) const;

  cv::Mat image_, hole_, source_, target_, origin_, depth_;
  int radius_;
  float scale_;
  std::uint32_t seed_;
  int sweep_ = 0;
  std::vector<Match> matches_;
  std::vector<cv::Point> sources_;
};

}  // namespace calipso::render

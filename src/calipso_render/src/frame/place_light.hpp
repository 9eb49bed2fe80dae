#pragma once

#include <opencv2/core.hpp>

#include "frame/edited_region.hpp"
#include "frame/moved_shadow.hpp"
#include "frame/resting_light.hpp"
#include "frame/seen_place.hpp"
#include "frame/square_mask.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

constexpr int kSameLevels = 4;  // of a lightLevel(): no visible change

// Sun and sky on the place in what an edit can change, before it and now, where now can matter:
// where they may differ from before, around where the sun may, and where the place behind an object
// comes to light.
class PlaceLight {
 public:
  // All of them must outlive this.
  // @param covered squares so deep behind drawn surfaces that light there does not matter
  PlaceLight(const StagedFrame& frame, const SeenPlace& place, const RestingLight& resting,
             const MovedShadow& moved, const EditedRegion& region, const SquareMask& covered);

  // CV_8UC1 over the region: lightLevel() of sun and sky on support plane or relief, this in plane
  // terms; now: in relightable() squares
  const cv::Mat& sun() const { return sun_; }
  const cv::Mat& sky() const { return sky_; }
  const cv::Mat& sunBefore() const { return sun_before_; }
  const cv::Mat& skyBefore() const { return sky_before_; }
  // 255 = support plane or relief is seen, on which light changes
  const cv::Mat& takes() const { return takes_; }
  // how far the original's shadow is there, which is to be taken from the plate
  const cv::Mat& relit() const { return relit_; }
  // Squares beyond which neither light changes nor anything comes to light.
  const SquareMask& relightable() const { return relightable_; }

 private:
  void measure(const cv::Rect& revealed, const SquareMask& covered);
  void findSkyChanges(const SkyGrid& now, const SkyGrid& before, SquareMask& changes);
  void takeObservedSky(const SkyGrid& observed);
  void findWallChanges(SquareMask& changes);
  void measureRun(const SkyGrid& sky_grid, int v, int begin, int end);
  void findRelit();
  void leaveDeepShade(const cv::Rect& box, int reach, cv::Mat& relit) const;
  void findChange(int v, int from, int to, std::uint8_t* out) const;

  const StagedFrame& frame_;
  const SeenPlace& place_;
  const RestingLight& resting_;
  const MovedShadow& moved_;
  const cv::Rect region_;
  cv::Mat sun_, sky_, sun_before_, sky_before_, takes_, relit_;
  SquareMask sun_changes_;  // squares in which the light may change by more than a pixel can follow
  SquareMask relightable_;
};

}  // namespace calipso::render

#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/visibility.hpp"
#include "frame/plane_sky.hpp"
#include "frame/seen_place.hpp"
#include "frame/square_mask.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

// Light on the place before an edit, which stays the same while the same objects are edited under
// the same camera: what is not edited, or follows the video, shades (the others), and what the
// edited objects shade where the video has them (the originals). Pictures are CV_8UC1 of the whole
// frame: lightLevel() of sun or sky on support plane or relief there.
class RestingLight {
 public:
  // Brings it up to date: after it this light is that of the frame.
  const RestingLight& update(const StagedFrame& frame, const SeenPlace& place);

  // What the others hide of the sun; its levels, empty: nothing.
  const Visibility& others() const { return *others_; }
  const cv::Mat& othersSun() const { return others_sun_; }
  // ... under the sun of the video, which an edit may have moved.
  const cv::Mat& othersSunInVideo() const { return others_sun_in_video_; }
  // Of the edited objects where the video has them; null: of none.
  const Visibility* originals() const { return originals_.get(); }
  const SkyGrid& originalsSky() const { return originals_sky_; }
  const cv::Mat& originalsSkyLevels() const { return originals_sky_levels_; }
  bool shadesWalls() const { return shades_walls_; }  // they hide some of the sky from walls
  // Squares that originals are not known to leave all lit by the sun.
  const SquareMask& sunless() const { return sunless_; }

  // Of originals and others together; of the relief in plane terms.
  const cv::Mat& sunBefore() const { return sun_before_; }
  const cv::Mat& skyBefore() const { return sky_before_; }
  // 255 = support plane or relief is seen, on which light changes.
  const cv::Mat& takes() const { return takes_; }
  // 255 = darkened by the originals, grown by the shadow's margin.
  const cv::Mat& shaded() const { return shaded_; }
  const cv::Rect& shadedBox() const { return shaded_box_; }
  // Of all that the originals' shadows can reach; of what they cover at the key frame.
  const cv::Rect& bounds() const { return bounds_; }
  const cv::Rect& footprints() const { return footprints_; }

  // The others' part of the light of edited objects alone, columns [begin, end) of row v. Edited
  // objects hide only that part of the sky which others leave: the picture's pixels lack theirs
  // already. Where scenery keeps the sun off anyhow it counts as seen: plate and picture lack it.
  void addOthersSun(int v, int begin, int end, std::uint8_t* sun) const;
  void leaveHidden(int v, int begin, int end, std::uint8_t* sky) const;

 private:
  void measureOthers(const StagedFrame& frame, const SeenPlace& place,
                     const std::vector<Occluder>& others, const std::vector<Occluder>& unedited);
  void measureOriginals(const StagedFrame& frame, const SeenPlace& place);
  void findShaded(const StagedFrame& frame, const SeenPlace& place);
  void join(const StagedFrame& frame, const SeenPlace& place);
  void joinSun(const SeenPlace& place, int v);

  std::vector<bool> edited_;  // per surface: which ones it is for
  Camera camera_;
  Eigen::Vector3f sun_ = Eigen::Vector3f::Zero();  // direction
  std::vector<Points> others_vertices_;            // of what is not edited
  std::unique_ptr<Visibility> others_, originals_;
  cv::Mat sunless_place_;  // SeenPlace::sunless, under the video's sun; else empty
  // of the others; empty: nothing else casts a shadow
  cv::Mat others_sun_, others_sun_in_video_, others_sky_;
  cv::Mat originals_sun_;  // empty: the originals cast none
  SkyGrid originals_sky_;
  cv::Mat originals_sky_levels_;
  bool shades_walls_ = false;
  SquareMask sunless_;
  cv::Mat sun_before_, sky_before_, takes_, shaded_;
  cv::Rect footprints_, shaded_box_, bounds_;
};

}  // namespace calipso::render

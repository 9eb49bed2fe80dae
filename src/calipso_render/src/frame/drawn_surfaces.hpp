#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "frame/edited_region.hpp"
#include "frame/seen_place.hpp"
#include "frame/square_mask.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

// Which surfaces the pixels of an edited region see, and which of those are drawn: edited ones, and
// others where the original picture does not show them.
class DrawnSurfaces {
 public:
  // All of them must outlive this.
  // @param removed CV_8UC1 over the region: pixels of edited objects in the video
  DrawnSurfaces(const StagedFrame& frame, const SeenPlace& place, const EditedRegion& region,
                const cv::Mat& removed);

  // What the pixels' centres see.
  const VisibilityBuffer& centre() const { return centre_; }
  // Samples of the pixels that silhouettes cross. Costly.
  EdgeCoverage sampleEdges() const;

  // @param id of what pixel (u, v) of the picture sees
  bool isDrawn(std::uint32_t id, int u, int v) const;
  // Is all of it drawn that is seen?
  bool isAllDrawn() const { return all_drawn_; }
  // CV_8UC1 over the region: 255 = isDrawn() at the pixel's centre
  const cv::Mat& mask() const { return mask_; }
  // Squares so deep behind drawn surfaces that light there does not matter.
  const SquareMask& covered() const { return covered_; }

 private:
  void findMask();

  const StagedFrame& frame_;
  const SeenPlace& place_;
  const cv::Rect region_, box_;  // box_: of all that is drawn
  const cv::Mat removed_;
  std::vector<bool> always_drawn_;  // per slot: isDrawn() wherever it is seen
  bool all_drawn_;                  // every slot is
  VisibilityBuffer centre_;
  cv::Mat mask_;
  SquareMask covered_;
};

}  // namespace calipso::render

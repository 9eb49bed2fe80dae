#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/visibility.hpp"
#include "frame/square_mask.hpp"
#include "place/plane_view.hpp"

namespace calipso::render {

// What support planes get of the sky's light. It changes slowly but close to a contact: measured on
// a grid that hangs on the picture and interpolated, and pixel by pixel where the grid's places
// differ. Where no plane is seen it is all of it.
class SkyGrid {
 public:
  SkyGrid() = default;

  // @param region of a picture of `picture` pixels
  // @param skip where it is not wanted
  SkyGrid(const PlaneView& planes, const Visibility& sky, const cv::Size& picture,
          const cv::Rect& region, const SquareMask& skip);

  // lightLevel() of skyLight() at columns [begin, end) of row v of the picture, by what the grid
  // was made of.
  void levels(const PlaneView& planes, const Visibility& sky, int v, int begin, int end,
              std::uint8_t* out) const;

  // How much the light at pixels of `rect` can differ from that of another grid of the same
  // picture, per column of cells that it meets: of step() px, the first of which has its first
  // column; 1 where it is not known.
  std::vector<float> differences(const SkyGrid& other, const cv::Rect& rect) const;
  int step() const { return step_; }

 private:
  void measureRow(const PlaneView& planes, const Visibility& sky, const SquareMask& skip, int j);
  bool isUneven(const SquareMask& skip, int i, int j) const;
  void interpolate(int v, int begin, int end, std::uint8_t* out) const;
  cv::Rect cellsOf(const cv::Rect& rect) const;

  int step_ = 1;     // px between places
  cv::Point first_;  // the first place, in steps
  cv::Mat light_;    // CV_32FC1 at the places
  cv::Mat uneven_;   // CV_8UC1 per cell: 255 = not to be interpolated
};

}  // namespace calipso::render

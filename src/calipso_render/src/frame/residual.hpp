#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "frame/rest_picture.hpp"
#include "frame/revealed_place.hpp"
#include "frame/row.hpp"
#include "frame/staged_frame.hpp"
#include "frame/still_pixels.hpp"

namespace calipso::render {

// What drawing misses: the video's pixels around an object at rest, less the same pixels drawn,
// move along with it. Unmoved, the drawn object is the video again, grain and all.
class Residual {
 public:
  // All of them must outlive this.
  // @param centre what the pixels of the region see
  // @param rest of the edited objects that the video has at rest
  Residual(const StagedFrame& frame, const RevealedPlace& revealed, const VisibilityBuffer& centre,
           const RestPicture& rest);

  // To pixels [first, last) of the region's row of picture row v that have moved little, by their
  // places in row.run.
  void addToStretch(int v, int first, int last, int slot, Row& row) const;
  // To pixel (u, v), which sees a triangle `id`. @param colour linear, and what carries no noise
  void addToPixel(std::uint32_t id, int u, int v, cv::Vec4f& colour) const;
  // To the pixels of picture row v that a rim has come to, and that are not the video's own.
  void addRims(int v, const StillPixels& still, Row& row) const;

 private:
  // What drawing misses beyond the silhouette, where a surface's rim has come to.
  struct Rim {
    int u, v;           // of the region
    cv::Point nearest;  // drawn pixel
  };

  cv::Rect carriedBox() const;
  void findMiss(const cv::Rect& carried);
  bool carries(const StagedObject& object) const;
  void findRims(const cv::Rect& carried);
  bool owns(int surface, const cv::Point& at) const;
  template <class Act>
  void forEachOwned(float u, float v, int owner, const Act& act) const;
  bool mayBeDimmed(int surface) const;
  cv::Vec3f dimmed(float u, float v, int owner, const cv::Vec3f& tint,
                   const cv::Vec4f& colour) const;
  void addAt(float u, float v, const Eigen::Vector2f& moved, int owner, const cv::Vec3f& tint,
             cv::Vec4f& colour) const;
  cv::Vec4f missAt(float u, float v, int owner) const;

  const StagedFrame& frame_;
  const RevealedPlace& revealed_;
  const VisibilityBuffer& centre_;
  const RestPicture& rest_;
  const cv::Rect region_;
  cv::Rect miss_box_;
  // CV_32FC4 over miss_box_: what drawing misses of the video, linear, and 1 where that is known;
  // may be empty
  cv::Mat miss_;
  std::vector<Rim> rims_;              // by rows
  std::vector<std::size_t> rim_rows_;  // per row of the region: its first in rims_, and one more
};

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_flow/frame.hpp"
#include "calipso_flow/object_model.hpp"
#include "calipso_flow/patch_match.hpp"
#include "calipso_flow/surface_view.hpp"

namespace calipso::flow {

// A frame with the object's pose in it, from which the object's look is taken: later frames are
// compared with this one, not with their predecessor, so that errors do not add up.
class ReferenceView {
 public:
  // @param mask  CV_8U of the picture's size, non-zero where the object is seen; empty: everywhere
  //   on its surface
  // @param seed_count  most surface points to follow
  ReferenceView(const Frame& frame, const ObjectModel& model,
                const Eigen::Isometry3d& world_from_object, const cv::Mat& mask, int seed_count);

  // What `camera` would see with the object at `world_from_object`: the reference's pixels moved
  // along the model's surface.
  struct Warped {
    ImageWindow gray;
    ImageWindow weight;     // 1 where the pixel is known, else 0
    cv::Mat covered;        // CV_8U, of the same window: non-zero where the surface is
    double coverage = 0.0;  // share of the visible surface's pixels that the reference knows
  };
  Warped warp(const Camera& camera, const Eigen::Isometry3d& world_from_object) const;
  // The same with the surface deformed besides. @param deformed  #V x 3, object frame
  Warped warp(const Camera& camera, const Eigen::Isometry3d& world_from_object,
              const decltype(TriangleMesh::vertices)& deformed) const;

  // The same from pictures `factor` times smaller, for a first look.
  ReferenceView reduced(int factor) const;
  int seenPixels() const;  // in which the reference knows the object

  // Surface points on a regular grid of the picture, about `count`, object frame, m.
  std::vector<Eigen::Vector3d> gridPoints(int count) const;

  const std::vector<Eigen::Vector3d>& seeds() const { return seeds_; }  // object frame, m
  const Eigen::Isometry3d& worldFromObject() const { return world_from_object_; }
  const Frame& frame() const { return frame_; }

 private:
  void chooseSeeds(int count);
  // Notes where the reference shows a surface point (p_reference, its camera frame) for pixel (x,
  // y) of the warped view. False where it does not show it.
  struct WarpMap;
  bool note(const Eigen::Vector3d& p_reference, int x, int y, WarpMap& map) const;
  Warped finish(const WarpMap& map, int visible, int known) const;

  Frame frame_;
  TriangleMesh mesh_;
  double diagonal_;  // m
  Eigen::Isometry3d world_from_object_;
  SurfaceView surface_;
  cv::Mat usable_;  // CV_8U over the surface's window
  std::vector<Eigen::Vector3d> seeds_;
};

}  // namespace calipso::flow

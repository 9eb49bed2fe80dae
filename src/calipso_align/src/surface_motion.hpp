#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "body_pose.hpp"
#include "calipso_align/silhouette.hpp"

// How a body whose surface is known moves from one frame to the next, by what the surface shows.
namespace calipso::align {

// What the surface says about a pose.
struct SurfaceLook {
  double difference = 1.0;  // 0..1: how little of it looks as it did
  Matrix6 information = Matrix6::Zero();
};

// Two frames, grey, and the backward flow between them.
struct FramePair {
  cv::Mat previous, now;  // CV_8U
  cv::Mat flow;           // CV_32FC2
  // CV_8U, may be empty: where something stood before the body in the previous frame; where this
  // one shows the background as it was, so that something may stand before it
  cv::Mat hidden = {}, as_before = {};
};

// Moves a body to where its surface looks as it did,
//   sum_i rho(I(project(T p_i)) - (1 + light . n_i) I_0(x_i)),  with the light that fits,
// from blurred pictures to sharp ones, starting from where the flow under `core` puts it and from
// where it goes if it moves on as it did; the better end counts.
// before    the previous frame's depth of the surface
// velocity  camera frame motion from the frame before that to the previous one
// pose      of the previous frame; out: of this one
SurfaceLook followSurface(const FramePair& frames, const cv::Mat& core, const Camera& camera,
                          const DepthRendering& before, const Eigen::Isometry3d& velocity,
                          BodyPose& pose);

}  // namespace calipso::align

#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_align/gaussian_mixture.hpp"

namespace calipso::align {

// What a depth image of the picture says about where things end. Inverse depth is used because
// planes are planes in (u, v, 1 / depth), and in units of its own noise, because those need no
// setting.
struct Relief {
  enum State : uchar { kUnusable = 0, kNone = 1, kSurface = 2 };
  // CV_32FC3: u, v (px) and inverse depth in half standard deviations of its noise
  cv::Mat surface;
  cv::Mat state;    // CV_8U: kUnusable near edges when `registered` is false, kNone without depth
  cv::Mat pieces;   // CV_32S: planar_pieces.hpp; empty unless `registered`
  cv::Mat planes;   // CV_32S: likewise, sharedPlanes()
  cv::Mat islands;  // CV_32S: surface_islands.hpp; empty unless `registered`
  cv::Mat on_support;  // CV_8U: the surface is that of a support plane, within its noise; or empty
  // CV_32S: number from 1 of what hangs together in the picture and is no support; empty unless
  // `registered` and there are supports
  cv::Mat raised;
  double units = 0.0;       // of `surface` per inverse metre
  double volume = 0.0;      // px x px x units of inverse depth: where a surface may be
  bool registered = false;  // its edges lie on the picture's edges to a pixel: measured

  bool empty() const { return state.empty(); }
};

// image CV_8UC3; depth CV_32F along the optical axis, m, 0 where there is none; of equal size.
// A relief without any depth, or without any picture edge to compare it with, is empty.
// supports: as `depth`, of planes that carry objects.
Relief makeRelief(const cv::Mat& image, const cv::Mat& depth,
                  const std::vector<cv::Mat>& supports = {});

// Part `view` of a relief in another size: nearest samples, so that no depth between two surfaces
// is made up.
Relief resized(const Relief& relief, const cv::Rect& view, const cv::Size& size);

// How a label change between p and p + step counts as an occlusion: inverse depth there minus what
// the surface on either side continues to, the smaller of the two; huge where one side has no
// depth.
float jump(const Relief& relief, const cv::Point& p, const cv::Point& step);

// Mean jump between horizontal neighbours under a mask (CV_8U).
float meanJump(const Relief& relief, const cv::Mat& mask);

// Where the surfaces of a label lie, and how often it has none (sky, a sensor's blind spots).
// Places in the picture count, so that it is an intensity: a small object claims little of it.
class SurfaceModel {
 public:
  // samples: pixels that are taken for the label's (CV_8U); strokes: those that are, which tell
  // how often it has no depth (or empty: the samples do); share: of the picture's part in question
  // that is the label's.
  static SurfaceModel fit(const Relief& relief, const cv::Mat& samples, const cv::Mat& strokes,
                          double share, int components);

  // Negative log intensity of what is seen at a pixel, nats.
  float cost(const Relief& relief, int x, int y) const;

  // Of any surface, wherever it lies.
  float someCost() const { return some_cost_; }

 private:
  std::vector<GaussianMixture> surfaces_;  // one, or none without enough samples
  float none_cost_ = 0.0f, some_cost_ = 0.0f, outlier_cost_ = 0.0f;
};

}  // namespace calipso::align

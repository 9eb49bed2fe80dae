#pragma once

#include <memory>
#include <vector>

#include "calipso_render/renderer.hpp"

namespace calipso::render {

// The stated case of drawing speed: one bumpy ball of 20 000 triangles that covers a quarter of
// 1280 x 720, above a table that takes its shadow.
struct DrawingCase {
  RenderParams params;
  std::shared_ptr<const Prepared> prepared;
  cv::Mat frame;          // CV_8UC3, the ball at rest
  double coverage = 0.0;  // part of the picture
  int triangles = 0;

  FrameInput input(
      int k) const;  // frame k: the ball swells and sinks a little, so that every vertex moves
  Points verticesAt(int k) const;  // world, m
};

DrawingCase makeDrawingCase(Quality quality);

}  // namespace calipso::render

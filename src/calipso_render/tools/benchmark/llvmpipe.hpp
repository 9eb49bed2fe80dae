#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "drawing_case.hpp"

namespace calipso::render {

// The drawing case's mesh by OpenGL without a window, on whatever software rasteriser Mesa has
// (llvmpipe): microfacet shading per pixel, no shadow. A frame: new vertices in, picture out.
class LlvmpipeDrawing {
 public:
  // @throw std::runtime_error naming what OpenGL lacks
  explicit LlvmpipeDrawing(const DrawingCase& drawing);
  ~LlvmpipeDrawing();

  cv::Mat draw(const Points& vertices);  // CV_8UC3
  std::string renderer() const;

 private:
  struct Context;
  Context* context_;
  const DrawingCase& drawing_;
};

}  // namespace calipso::render

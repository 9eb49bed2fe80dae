#pragma once

#include <opencv2/core.hpp>

#include "draw/triangle_map.hpp"
#include "drawing_case.hpp"
#include "frame/line_codec.hpp"
#include "place/plane_view.hpp"

namespace calipso::render {

// What LlvmpipeDrawing does, by the stages that draw a frame's surfaces: the drawing case's mesh
// alone, without shadow, in an empty picture, its edges as the pixels' centres see them. A frame:
// new vertices in, picture out.
class MeshDrawing {
 public:
  explicit MeshDrawing(const DrawingCase& drawing);

  cv::Mat draw(const Points& vertices) const;  // CV_8UC3

 private:
  void drawRow(const Actor& actor, const SurfaceMaps& maps, const VisibilityBuffer& seen, int v,
               SurfaceRun& run, cv::Mat& picture) const;
  void addTexture(const Actor& actor, const SurfaceMaps& maps, const std::uint32_t* ids, int u,
                  int v, int count, SurfaceRun& run) const;

  const Prepared& prepared_;
  const PlaneView sight_;
  const SurfaceShade shade_;
  const LineCodec codec_;  // without noise
};

}  // namespace calipso::render

#pragma once

#include <opencv2/core.hpp>

#include "frame/backdrop.hpp"
#include "frame/drawn_surfaces.hpp"
#include "frame/residual.hpp"
#include "frame/row.hpp"
#include "frame/row_kinds.hpp"
#include "frame/screen.hpp"
#include "frame/sheets.hpp"
#include "frame/staged_frame.hpp"
#include "frame/surface_shader.hpp"

namespace calipso::render {

// Composes the region row by row. Stretches of pixels that see one object are shaded together, so
// are such of the place; silhouettes and what else is special one by one.
class RowComposer {
 public:
  // All of them must outlive this.
  // @param residual null: none is carried over
  RowComposer(const StagedFrame& frame, const DrawnSurfaces& surfaces, const RowKinds& kinds,
              const Sheets& sheets, const SurfaceShader& shader, const Backdrop& backdrop,
              const Screen& screen, const Residual* residual);

  // Picture row v in linear colours.
  void compose(int v, Row& row) const;

 private:
  void drawStretch(int v, int first, int last, Row& row) const;
  void drawThin(int v, int first, int last, Row& row) const;
  void composeSpecial(int u, int v, Row& row) const;

  const StagedFrame& frame_;
  const RowKinds& kinds_;
  const Sheets& sheets_;
  const SurfaceShader& shader_;
  const Backdrop& backdrop_;
  const Screen& screen_;
  const Residual* residual_;
  const VisibilityBuffer& centre_;
  const cv::Rect region_;
};

}  // namespace calipso::render

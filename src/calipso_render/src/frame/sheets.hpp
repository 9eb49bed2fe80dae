#pragma once

#include <vector>

#include "frame/drawn_surfaces.hpp"
#include "frame/row.hpp"
#include "frame/screen.hpp"
#include "frame/surface_shader.hpp"

namespace calipso::render {

// Draws pixels which see more than the middle of one triangle: silhouettes by a place for each
// sheet in them.
class Sheets {
 public:
  // All of them must outlive this.
  Sheets(const DrawnSurfaces& surfaces, const EdgeCoverage& edges, const SurfaceShader& shader,
         const Screen& screen);

  // Of picture row v, into row.drawn.
  void draw(int v, Row& row) const;

 private:
  void find(int v, Row& row) const;
  void add(int u, int v, std::vector<Sheet>& sheets) const;
  void shade(int v, Row& row) const;

  const DrawnSurfaces& surfaces_;
  const EdgeCoverage& edges_;
  const SurfaceShader& shader_;
  const Screen& screen_;
  const cv::Rect region_;
};

}  // namespace calipso::render

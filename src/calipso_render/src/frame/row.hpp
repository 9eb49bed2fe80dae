#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "draw/surface_run.hpp"
#include "draw/triangle_map.hpp"

namespace calipso::render {

// What a drawn surface adds to a pixel.
struct Drawn {
  cv::Vec3f colour;  // linear
  float cover = 0.0f;
  float grain = 0.0f;  // Appearance::grain
};

// A sheet of a surface in a pixel that sees several, or sees one end.
struct Sheet {
  SurfacePlace place;
  int column;  // of the row
  float part;  // of the pixel
};

// What has to be done for a pixel: nothing; one drawn surface, the same where it ends or folds;
// what lies behind, in other light; more than one surface.
enum Kind : std::uint8_t { kNone = 0, kPlain = 1, kBehind = 2, kPlainEdge = 4, kSpecial = 8 };
inline bool isPlain(Kind kind) { return kind == kPlain || kind == kPlainEdge; }

// A row of the result over the region that an edit can change, on its way.
struct Row {
  // Linear B, G, R; the part that carries no noise yet, and the deviation that its noise has at
  // least, code values. Up to seven more than the row has.
  std::vector<float> colour[5];
  std::vector<std::uint8_t> source;  // Provenance
  std::vector<Kind> kinds;
  std::vector<Drawn> drawn;   // of pixels that need more than their centre
  std::vector<Sheet> sheets;  // of those, in the order of their columns
  SurfaceRun run;

  void resize(std::size_t width) {
    for (auto& channel : colour) channel.resize(width + 7);
    source.resize(width), kinds.resize(width), drawn.resize(width);
  }
  cv::Vec4f at(int i) const { return {colour[0][i], colour[1][i], colour[2][i], colour[3][i]}; }
  void set(int i, const cv::Vec4f& c) {
    for (int k = 0; k < 4; ++k) colour[k][i] = c[k];
  }
};

}  // namespace calipso::render

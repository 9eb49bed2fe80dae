#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "draw/light_batch.hpp"
#include "draw/triangle_map.hpp"
#include "frame/drawn_surfaces.hpp"
#include "frame/moved_shadow.hpp"
#include "frame/resting_light.hpp"
#include "frame/row.hpp"
#include "place/plane_view.hpp"

namespace calipso::render {

// px between the places where the sun on a smooth surface is looked up
constexpr int kLightStep = 4;

// The sun on the drawn surfaces. Where it changes little between the corners of small squares,
// which hang on the picture, it is interpolated, elsewhere looked up at the pixel.
class SurfaceSun {
 public:
  // All of them must outlive this.
  // @param planes of the frame's camera: its sight lines
  // @param maps per slot
  SurfaceSun(const StagedFrame& frame, const PlaneView& planes, const DrawnSurfaces& surfaces,
             const std::vector<SurfaceMaps>& maps, const MovedShadow& moved,
             const RestingLight& resting);

  // On pixels [first, last) of the region's row of picture row v, all of which see the object in
  // `slot`: row.run.sun, but at kPlainEdge pixels where it does not follow from the corners.
  void onStretch(int v, int first, int last, int slot, Row& row) const;
  // Where the sun on a place of one object follows from the corners around: that.
  std::optional<float> between(float u, float v, float nearness, int slot) const;
  // Looks the sun up at some places of a run; those that face away from it get none.
  // @param nearness of the run's places along their sight lines of depth 1, 1/m; null: the lines
  // end at the places
  void onPlaces(const int* places, int count, const float* nearness, SurfaceRun& run) const;

 private:
  // The sun where a grid's lines meet on a drawn surface.
  struct Corner {
    float sun = 0.0f, nearness = 0.0f;  // visible part; 1/m
    int slot = -1;                      // -1: nothing is drawn here
  };
  // Corners of one row that see one object.
  struct CornerRun {
    int slot, count;
    std::uint32_t ids[SurfaceRun::kRoom];
    int corners[SurfaceRun::kMost];  // columns of the grid
    SurfaceRun run;
  };

  void find();
  void lightCorners(int j, int first, const std::vector<std::uint8_t>& large);
  int slotAt(int i, int v, const std::uint32_t* ids) const;
  void lookUp(int v, CornerRun& wanted, Corner* corners) const;
  bool isSmooth(int i, int j, int size) const;
  bool isSmoothAround(int i, int j, const std::vector<std::uint8_t>& large) const;
  void lookAt(const LightBatch& points, float* sun) const;
  std::size_t cornerAt(int i, int j) const { return static_cast<std::size_t>(j) * columns_ + i; }

  const StagedFrame& frame_;
  const PlaneView& planes_;
  const DrawnSurfaces& surfaces_;
  const std::vector<SurfaceMaps>& maps_;
  const MovedShadow& moved_;
  const RestingLight& resting_;
  const cv::Rect region_;
  cv::Point origin_;  // of the picture: the first corner's place
  int columns_ = 0, rows_ = 0;
  std::vector<Corner> corners_;
  // per square, by its first corner: the sun between the corners follows from theirs
  std::vector<std::uint8_t> smooth_;
};

}  // namespace calipso::render

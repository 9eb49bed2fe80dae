#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/rasterizer.hpp"

namespace calipso::render {

// An edge of a mesh and the two triangles beside it (b = -1 at a border).
struct MeshEdge {
  int from, to, a, b;
};

// Every edge once, in a fixed order.
std::vector<MeshEdge> meshEdges(const Triangles& triangles);

// Sub-pixel visibility where one is needed: 4 x 4 samples in the pixels that a silhouette crosses.
// Inside a silhouette the pixel's centre speaks for it.
class EdgeCoverage {
 public:
  static constexpr int kGrid = 4;
  static constexpr int kSamples = kGrid * kGrid;
  struct Pixel {
    std::array<std::uint32_t, kSamples> ids;
    std::array<float, kSamples> nearness;
  };

  // Chooses the pixels in which `centre` sees another object than in a neighbour.
  // @param box of what it sees, region coordinates, with a pixel around it
  EdgeCoverage(const VisibilityBuffer& centre, const cv::Rect& box);

  // Adds the pixels that the mesh's own silhouette crosses (parts thinner than a pixel), but for
  // those that another sheet hides. @param centre as in the constructor
  void chooseSilhouette(const ScreenMesh& mesh, const std::vector<MeshEdge>& edges,
                        const VisibilityBuffer& centre);

  // Draws into the chosen pixels. @pre nothing is chosen after the first draw
  void draw(const ScreenMesh& mesh, int object);

  // Once all is drawn: lets the centre speak for pixels whose samples see what it sees, and all of
  // them one sheet.
  void settle(const VisibilityBuffer& centre);

  // nullptr where the pixel's centre speaks for it. Picture coordinates.
  const Pixel* at(int u, int v) const;

  // Calls visit(column, settled) for a row's chosen pixels, ascending. Region coordinates.
  template <class Visit>
  void visitRow(int row, const Visit& visit) const {
    for (int i = 0; i < tiles_across_; ++i) {
      const int tile = tiles_[static_cast<std::size_t>(row / kTile) * tiles_across_ + i];
      if (tile < 0) continue;
      const int* slots =
          &slots_[static_cast<std::size_t>(tile) * kTile * kTile + (row % kTile) * kTile];
      for (int k = 0; k < kTile; ++k) {
        if (slots[k] != kNone) visit(i * kTile + k, slots[k] == kSettled);
      }
    }
  }

  // Do samples of one object, of these nearnesses, see one sheet of it? Numbers or lanes of them.
  template <class Nearness>
  static auto isOneSheet(const Nearness& nearest, const Nearness& farthest) {
    return nearest - farthest <= kSameSheet * farthest;
  }

  // Position of a sample against its pixel's centre, px.
  static Eigen::Vector2f offset(int sample) {
    return {(sample % kGrid + 0.5f) / kGrid - 0.5f, (sample / kGrid + 0.5f) / kGrid - 0.5f};
  }

 private:
  // of the nearness: samples that differ by more see another part of an object
  static constexpr float kSameSheet = 0.015f;

  // A triangle over the pixels of a tile that it may touch.
  struct Piece;

  void choose(int column, int row);  // region coordinates
  void addCrossed(const Eigen::Vector3f& p, const Eigen::Vector3f& q,
                  const VisibilityBuffer& centre, std::vector<cv::Point>& crossed) const;
  void addPieces(const ScreenMesh& mesh, int triangle, std::uint32_t id,
                 std::vector<Piece>& pieces) const;
  int slotAt(int column, int row) const {
    const int tile = tiles_[static_cast<std::size_t>(row / kTile) * tiles_across_ + column / kTile];
    return tile < 0 ? kNone
                    : slots_[static_cast<std::size_t>(tile) * kTile * kTile +
                             (row % kTile) * kTile + column % kTile];
  }

  static constexpr int kTile = 8;  // px
  static constexpr int kNone = -1, kSettled = -2;

  cv::Rect region_;
  int tiles_across_;
  std::vector<int> tiles_;  // index of the tile in slots_, -1: none of its pixels is chosen
  std::vector<int> slots_;  // per pixel of those tiles: index into pixels_, kNone or kSettled
  std::vector<std::uint64_t> chosen_;  // per tile: a bit for each pixel that has a slot, by rows
  std::vector<Pixel> pixels_;
};

}  // namespace calipso::render

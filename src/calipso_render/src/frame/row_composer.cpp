#include "frame/row_composer.hpp"

#include <algorithm>
#include <cstring>

#include "draw/wide_loops.hpp"
#include "frame/marked.hpp"

namespace calipso::render {
namespace {

// How many of the pixels see the object that the first sees, from that on.
CALIPSO_WIDE_LOOPS int countOfFirst(const std::uint32_t* ids, int count) {
  std::uint32_t differ = 0;
  for (int k = 0; k < count; ++k) differ |= ids[k] ^ ids[0];
  if ((differ >> 24) == 0) return count;
  int same = 1;
  while (((ids[same] ^ ids[0]) >> 24) == 0) ++same;
  return same;
}

}  // namespace

RowComposer::RowComposer(const StagedFrame& frame, const DrawnSurfaces& surfaces,
                         const RowKinds& kinds, const Sheets& sheets, const SurfaceShader& shader,
                         const Backdrop& backdrop, const Screen& screen, const Residual* residual)
    : frame_(frame),
      kinds_(kinds),
      sheets_(sheets),
      shader_(shader),
      backdrop_(backdrop),
      screen_(screen),
      residual_(residual),
      centre_(surfaces.centre()),
      region_(centre_.region()) {}

void RowComposer::compose(int v, Row& row) const {
  const std::uint32_t* ids = centre_.ids(v - region_.y);
  row.resize(region_.width);
  kinds_.find(v, row.kinds.data());
  sheets_.draw(v, row);
  std::memset(row.source.data(), kOriginal, row.source.size());
  std::fill(row.colour[4].begin(), row.colour[4].end(), 0.0f);
  for (int i = nextMarked(row.kinds.data(), 0, region_.width); i < region_.width;
       i = nextMarked(row.kinds.data(), i, region_.width)) {
    const int first = i, u = i + region_.x;
    if (isPlain(row.kinds[i])) {
      const int limit =
          std::min(region_.width, (u / SurfaceRun::kMost + 1) * SurfaceRun::kMost - region_.x);
      i += countOfFirst(ids + i, nextUnmarked(row.kinds.data(), i, limit, kPlain | kPlainEdge) - i);
      drawStretch(v, first, i, row);
    } else if (row.kinds[i] == kBehind) {
      i = nextUnmarked(row.kinds.data(), i, region_.width, kBehind);
      backdrop_.compose(v, first, i, row);
    } else {
      composeSpecial(u, v, row);
      ++i;
    }
  }
}

// Pixels [first, last) of picture row v that see one object alone.
void RowComposer::drawStretch(int v, int first, int last, Row& row) const {
  const int slot = VisibilityBuffer::objectOf(centre_.ids(v - region_.y)[first]);
  const unsigned traits = shader_.shadeStretch(v, first, last, slot, row);
  std::memset(&row.source[first], kRendered, last - first);
  if (residual_ != nullptr) residual_->addToStretch(v, first, last, slot, row);
  if ((traits & TriangleMap::kThin) != 0) drawThin(v, first, last, row);
}

// The same of those that see thin triangles, which need places of their own.
void RowComposer::drawThin(int v, int first, int last, Row& row) const {
  const std::uint32_t* ids = centre_.ids(v - region_.y);
  for (int i = first; i < last; ++i) {
    if (!shader_.isThin(ids[i])) continue;
    const int u = i + region_.x;
    const cv::Vec3f shaded = shader_.shadedThin(ids[i], u, v, row.run);
    cv::Vec4f colour(shaded[0], shaded[1], shaded[2], 1.0f);
    if (residual_ != nullptr) residual_->addToPixel(ids[i], u, v, colour);
    row.set(i, colour);
  }
}

// A pixel that needs more than one surface.
void RowComposer::composeSpecial(int u, int v, Row& row) const {
  const int i = u - region_.x;
  const Drawn& drawn = row.drawn[i];
  const Pixel behind = drawn.cover < 1.0f ? backdrop_.at(u, v) : Pixel{};
  const cv::Vec3f colour = drawn.cover * drawn.colour + (1.0f - drawn.cover) * behind.colour;
  cv::Vec4f out(colour[0], colour[1], colour[2], drawn.cover + (1.0f - drawn.cover) * behind.fresh);
  row.source[i] = drawn.cover > 0.0f ? kRendered : behind.source;
  row.colour[4][i] = drawn.cover * drawn.grain;
  const std::uint32_t id = centre_.idAt(u, v);
  if (residual_ != nullptr && row.source[i] != kOriginal && id != VisibilityBuffer::kNothing &&
      screen_.at(u, v) == 0.0f)
    residual_->addToPixel(id, u, v, out);
  row.set(i, out);
}

}  // namespace calipso::render

#include "frame/sheets.hpp"

#include <algorithm>
#include <array>

#include "draw/eight_lanes.hpp"
#include "draw/wide_loops.hpp"
#include "frame/marked.hpp"

namespace calipso::render {
namespace {

// A pixel's samples, those nearest to its centre first.
constexpr std::array<int, EdgeCoverage::kSamples> kFromCentre = [] {
  std::array<int, EdgeCoverage::kSamples> order{};
  const auto squared = [](int i) {  // eighths of a pixel
    const int x = 2 * (i % EdgeCoverage::kGrid) + 1 - EdgeCoverage::kGrid,
              y = 2 * (i / EdgeCoverage::kGrid) + 1 - EdgeCoverage::kGrid;
    return x * x + y * y;
  };
  for (int i = 0; i < EdgeCoverage::kSamples; ++i) {
    int place = i;
    for (; place > 0 && squared(order[place - 1]) > squared(i); --place)
      order[place] = order[place - 1];
    order[place] = i;
  }
  return order;
}();

// Which samples see the sheet that sample `of` sees, a bit for each.
CALIPSO_WIDE_LOOPS unsigned sheetOf(const EdgeCoverage::Pixel& edge, int of) {
  static_assert(EdgeCoverage::kSamples == 16);
  const Eight here = all(edge.nearness[of]);
  const EightInts id = EightInts{} + static_cast<std::int32_t>(edge.ids[of]);
  unsigned sees = 0;
  for (int half = 0; half < 2; ++half) {
    const Eight other = eightAt(&edge.nearness[8 * half]);
    const EightInts differ = *reinterpret_cast<const EightInts*>(&edge.ids[8 * half]) ^ id;
    sees |= bitsOf(EdgeCoverage::isOneSheet(larger(here, other), smaller(here, other)) &
                   ((differ >> 24) == 0))
            << 8 * half;
  }
  return sees;
}

}  // namespace

Sheets::Sheets(const DrawnSurfaces& surfaces, const EdgeCoverage& edges,
               const SurfaceShader& shader, const Screen& screen)
    : surfaces_(surfaces),
      edges_(edges),
      shader_(shader),
      screen_(screen),
      region_(surfaces.centre().region()) {}

void Sheets::draw(int v, Row& row) const {
  find(v, row);
  shade(v, row);
}

// One place for each sheet of each object in a pixel: the sample nearest to the pixel's centre.
void Sheets::add(int u, int v, std::vector<Sheet>& sheets) const {
  if (screen_.at(u, v) == 1.0f) return;
  const int column = u - region_.x;
  const EdgeCoverage::Pixel* edge = edges_.at(u, v);
  if (edge == nullptr) {
    const std::uint32_t id = surfaces_.centre().idAt(u, v);
    if (surfaces_.isDrawn(id, u, v))
      sheets.push_back({{id, static_cast<float>(u), static_cast<float>(v)}, column, 1.0f});
    return;
  }
  const auto draws = [&](std::uint32_t id) {
    return surfaces_.isAllDrawn() ? id != VisibilityBuffer::kNothing : surfaces_.isDrawn(id, u, v);
  };
  for (unsigned rest = (1u << EdgeCoverage::kSamples) - 1; rest != 0;) {
    const int first = __builtin_ctz(rest);
    if (!draws(edge->ids[first])) {
      rest &= rest - 1;
      continue;
    }
    const unsigned sees = sheetOf(*edge, first) & rest;
    rest &= ~sees;
    const int count = __builtin_popcount(sees),
              middle = *std::find_if(kFromCentre.begin(), kFromCentre.end(),
                                     [&](int sample) { return (sees >> sample & 1) != 0; });
    const Eigen::Vector2f x = Eigen::Vector2f(u, v) + EdgeCoverage::offset(middle);
    sheets.push_back({{edge->ids[middle], x.x(), x.y()},
                      column,
                      static_cast<float>(count) / EdgeCoverage::kSamples});
  }
}

// Sheets of the row's pixels that need more than their centre, or more than its triangle's map.
void Sheets::find(int v, Row& row) const {
  constexpr std::uint8_t kPlaces = kSpecial | kPlainEdge;
  row.sheets.clear();
  const Kind* kinds = row.kinds.data();
  for (int i = nextMarked(kinds, 0, region_.width, kPlaces); i < region_.width;
       i = nextMarked(kinds, i + 1, region_.width, kPlaces)) {
    row.drawn[i] = {};
    const float u = static_cast<float>(i + region_.x);
    if (kinds[i] == kSpecial)
      add(i + region_.x, v, row.sheets);
    else
      row.sheets.push_back(
          {{surfaces_.centre().ids(v - region_.y)[i], u, static_cast<float>(v)}, i, 1.0f});
  }
}

// Row v's sheets, into row.drawn.
void Sheets::shade(int v, Row& row) const {
  SurfacePlace places[SurfaceRun::kMost];
  const std::size_t all = row.sheets.size();
  for (std::size_t i = 0; i < all;) {
    const std::size_t first = i;
    const int slot = VisibilityBuffer::objectOf(row.sheets[i].place.id);
    for (; i < all && i - first < SurfaceRun::kMost &&
           VisibilityBuffer::objectOf(row.sheets[i].place.id) == slot;
         ++i)
      places[i - first] = row.sheets[i].place;
    shader_.shadePlaces(places, static_cast<int>(i - first), slot, row.run);
    for (std::size_t k = 0; k < i - first; ++k) {
      const Sheet& sheet = row.sheets[first + k];
      Drawn& drawn = row.drawn[sheet.column];
      drawn.cover += sheet.part;
      drawn.grain = std::max(drawn.grain, shader_.grainOf(slot));
      for (int c = 0; c < 3; ++c) drawn.colour[c] += sheet.part * row.run.colour[c][k];
    }
  }
  for (std::size_t i = 0; i < all; ++i) {
    const int column = row.sheets[i].column;
    if (i + 1 < all && row.sheets[i + 1].column == column) continue;
    Drawn& drawn = row.drawn[column];
    drawn.colour /= drawn.cover;
    drawn.cover *= 1.0f - screen_.at(column + region_.x, v);
  }
}

}  // namespace calipso::render

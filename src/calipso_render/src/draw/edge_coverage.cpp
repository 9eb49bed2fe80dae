#include "calipso_render/edge_coverage.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>
#include <optional>
#include <unordered_map>
#include <utility>

#include "draw/kernels.hpp"
#include "draw/triangle_span.hpp"
#include "draw/wide_loops.hpp"

namespace calipso::render {
namespace {

float signedArea(const ScreenMesh& mesh, const Eigen::Vector3i& t) {
  const Eigen::Vector3f &p = mesh.points[t[0]], &q = mesh.points[t[1]], &r = mesh.points[t[2]];
  return (q.x() - p.x()) * (r.y() - p.y()) - (r.x() - p.x()) * (q.y() - p.y());
}

// @param corners the triangle's, of area `area` as signedArea()
// @param origin of the samples' coordinates
TriangleSamples samplesOf(const ScreenMesh& mesh, const Eigen::Vector3i& corners, float area,
                          const cv::Point& origin) {
  const Eigen::Vector3f offset(origin.x, origin.y, 0.0f);
  Eigen::Vector3f p[3];
  for (int i = 0; i < 3; ++i) p[i] = mesh.points[corners[i]] - offset;
  if (area < 0.0f) std::swap(p[1], p[2]);
  TriangleSamples t{};
  const float per_area = 1.0f / std::abs(area);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3f &a = p[(i + 1) % 3], &b = p[(i + 2) % 3];
    t.edge_u[i] = a.y() - b.y(), t.edge_v[i] = b.x() - a.x(),
    t.edge_0[i] = (b.y() - a.y()) * a.x() - (b.x() - a.x()) * a.y();
    const float weight = p[i].z() * per_area;
    t.near_u += t.edge_u[i] * weight, t.near_v += t.edge_v[i] * weight,
        t.near_0 += t.edge_0[i] * weight;
  }
  return t;
}

// Meshes and tiles are split in fixed parts: the result knows no thread count.
constexpr int kParts = 32, kBands = 8;

int partOf(int count, int part) {
  return static_cast<int>(static_cast<long>(count) * part / kParts);
}

constexpr std::uint8_t kRight = 1, kDown = 2;

// Does the object seen change anywhere to the right of `count` pixels, or below them?
CALIPSO_WIDE_LOOPS bool changesWithin(const std::uint32_t* row, const std::uint32_t* below,
                                      int count) {
  std::uint32_t changes = 0;
  for (int u = 0; u < count; ++u) changes |= (row[u] ^ below[u]) | (row[u] ^ row[u + 1]);
  return (changes >> 24) != 0;
}

// Where it does: the columns, and how. @pre the row has a place more than `width`
void findChanges(const std::uint32_t* row, const std::uint32_t* below, int width,
                 std::vector<std::pair<int, std::uint8_t>>& found) {
  constexpr int kAtOnce = 64;
  for (int begin = 0; begin < width; begin += kAtOnce) {
    const int count = std::min(kAtOnce, width - begin);
    if (!changesWithin(row + begin, below + begin, count)) continue;
    for (int u = begin; u < begin + count; ++u) {
      const bool right = u + 1 < width && ((row[u] ^ row[u + 1]) >> 24) != 0,
                 down = ((row[u] ^ below[u]) >> 24) != 0;
      if (right || down)
        found.emplace_back(u, static_cast<std::uint8_t>((right ? kRight : 0) | (down ? kDown : 0)));
    }
  }
}

// SampledTile::wanted of columns [left, right] of rows [top, bottom].
std::uint64_t pixelsWithin(int left, int top, int right, int bottom) {
  static_assert(SampledTile::kSide == 8);
  const std::uint64_t columns = (0xffu << left) & (0xffu >> (7 - right)),
                      rows =
                          (~std::uint64_t{0} << 8 * top) & (~std::uint64_t{0} >> 8 * (7 - bottom));
  return columns * 0x0101010101010101ull & rows;
}

// Do all samples see the object that `id` names, and one sheet of it?
bool agree(const EdgeCoverage::Pixel& pixel, std::uint32_t id) {
  std::uint32_t differ = 0;
  for (const std::uint32_t sample : pixel.ids) differ |= sample ^ id;
  if ((differ >> 24) != 0) return false;
  cv::v_float32x4 low = cv::v_load(pixel.nearness.data()), high = low;
  for (int k = 4; k < EdgeCoverage::kSamples; k += 4) {
    const cv::v_float32x4 four = cv::v_load(&pixel.nearness[k]);
    low = cv::v_min(low, four), high = cv::v_max(high, four);
  }
  return id == VisibilityBuffer::kNothing ||
         EdgeCoverage::isOneSheet(cv::v_reduce_max(high), cv::v_reduce_min(low));
}

// Is a place hidden by another sheet? Its own sheet may turn away so fast that the pixel's centre
// is as much nearer; but beyond its edge, in the pixel beside, that one hides nothing.
// @param at region coordinates
bool isHidden(const VisibilityBuffer& centre, const cv::Point& at, float nearness) {
  const cv::Rect& region = centre.region();
  if (cv::Rect(1, 1, region.width - 2, region.height - 2).contains(at)) {
    const float* here = centre.nearness(at.y) + at.x;
    const float least =
        std::min({here[0], here[-1], here[1], here[-centre.stride()], here[centre.stride()]});
    return !EdgeCoverage::isOneSheet(least, nearness);
  }
  for (const cv::Point& to : {cv::Point(0, 0), {-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
    const cv::Point seen = at + to + region.tl();
    if (EdgeCoverage::isOneSheet(centre.nearnessAt(seen.x, seen.y), nearness)) return false;
  }
  return true;
}

}  // namespace

struct EdgeCoverage::Piece {
  TriangleSamples samples;
  std::uint64_t wanted;  // SampledTile::wanted
  int u, v;              // the tile's first pixel, region coordinates
  int tile;
  std::uint32_t id;
};

std::vector<MeshEdge> meshEdges(const Triangles& triangles) {
  std::unordered_map<std::uint64_t, int> found;
  std::vector<MeshEdge> edges;
  edges.reserve(triangles.size() * 3 / 2);
  for (int t = 0; t < static_cast<int>(triangles.size()); ++t) {
    for (int i = 0; i < 3; ++i) {
      const int from = std::min(triangles[t][i], triangles[t][(i + 1) % 3]);
      const int to = std::max(triangles[t][i], triangles[t][(i + 1) % 3]);
      const std::uint64_t key =
          (static_cast<std::uint64_t>(from) << 32) | static_cast<unsigned>(to);
      const auto [it, inserted] = found.try_emplace(key, static_cast<int>(edges.size()));
      if (inserted)
        edges.push_back({from, to, t, -1});
      else if (edges[it->second].b < 0)
        edges[it->second].b = t;
    }
  }
  return edges;
}

EdgeCoverage::EdgeCoverage(const VisibilityBuffer& centre, const cv::Rect& box)
    : region_(centre.region()),
      tiles_across_(centre.region().width / kTile + 1),
      tiles_(static_cast<std::size_t>(tiles_across_) * (centre.region().height / kTile + 1), -1) {
  // Per row of the box: columns of it, and where the object changes.
  std::vector<std::vector<std::pair<int, std::uint8_t>>> found(box.height);
#pragma omp parallel for schedule(static)
  for (int j = 0; j < box.height; ++j) {
    const int below = std::min(j + 1, box.height - 1);
    findChanges(centre.ids(box.y + j) + box.x, centre.ids(box.y + below) + box.x, box.width,
                found[j]);
  }
  for (int j = 0; j < box.height; ++j) {
    for (const auto& [i, change] : found[j]) {
      choose(box.x + i, box.y + j);
      if ((change & kRight) != 0) choose(box.x + i + 1, box.y + j);
      if ((change & kDown) != 0) choose(box.x + i, box.y + j + 1);
    }
  }
}

void EdgeCoverage::choose(int column, int row) {
  if (column < 0 || row < 0 || column >= region_.width || row >= region_.height) return;
  int& tile = tiles_[static_cast<std::size_t>(row / kTile) * tiles_across_ + column / kTile];
  if (tile < 0) {
    tile = static_cast<int>(slots_.size() / (kTile * kTile));
    slots_.resize(slots_.size() + kTile * kTile, kNone);
    chosen_.push_back(0);
  }
  const int place = (row % kTile) * kTile + column % kTile;
  int& slot = slots_[static_cast<std::size_t>(tile) * kTile * kTile + place];
  if (slot >= 0) return;
  slot = static_cast<int>(pixels_.size());
  chosen_[tile] |= std::uint64_t{1} << place;
  pixels_.emplace_back();
  pixels_.back().ids.fill(VisibilityBuffer::kNothing);
  pixels_.back().nearness.fill(VisibilityBuffer::kFar);
}

void EdgeCoverage::chooseSilhouette(const ScreenMesh& mesh, const std::vector<MeshEdge>& edges,
                                    const VisibilityBuffer& centre) {
  const int triangles = static_cast<int>(mesh.triangles->size()),
            count = static_cast<int>(edges.size());
  std::vector<char> turned(triangles);
  std::vector<cv::Point> crossed[kParts];  // by parts of the edges, in their order
#pragma omp parallel
  {
#pragma omp for schedule(static)
    for (int t = 0; t < triangles; ++t) turned[t] = signedArea(mesh, (*mesh.triangles)[t]) > 0.0f;
#pragma omp for schedule(static)
    for (int part = 0; part < kParts; ++part) {
      const int begin = partOf(count, part), end = partOf(count, part + 1);
      for (int k = begin; k < end; ++k) {
        const MeshEdge& edge = edges[k];
        if (edge.b < 0 || turned[edge.a] != turned[edge.b])
          addCrossed(mesh.points[edge.from], mesh.points[edge.to], centre, crossed[part]);
      }
    }
  }
  for (const auto& part : crossed) {
    for (const cv::Point& p : part) choose(p.x, p.y);
  }
}

// Pixels that an edge of a silhouette crosses, region coordinates. Behind another sheet nobody sees
// it: where that one ends, its own edge chooses the pixel.
void EdgeCoverage::addCrossed(const Eigen::Vector3f& p, const Eigen::Vector3f& q,
                              const VisibilityBuffer& centre,
                              std::vector<cv::Point>& crossed) const {
  if (std::isnan(p.z() + q.z())) return;
  const float length = std::min((q - p).head<2>().norm(), 2.0f * (region_.width + region_.height));
  const int steps = 1 + static_cast<int>(2.0f * length);
  for (int i = 0; i <= steps; ++i) {
    const Eigen::Vector3f s = p + (q - p) * (static_cast<float>(i) / steps);
    const cv::Point at(static_cast<int>(std::floor(s.x() + 0.5f)) - region_.x,
                       static_cast<int>(std::floor(s.y() + 0.5f)) - region_.y);
    if (!crossed.empty() && crossed.back() == at) continue;
    if (!isHidden(centre, at, s.z())) crossed.push_back(at);
  }
}

void EdgeCoverage::draw(const ScreenMesh& mesh, int object) {
  if (pixels_.empty()) return;
  const int count = static_cast<int>(mesh.triangles->size());
  // of the triangles that touch a chosen pixel's tile, in their order
  std::vector<Piece> pieces[kParts];
#pragma omp parallel
  {
#pragma omp for schedule(dynamic, 1)
    for (int part = 0; part < kParts; ++part) {
      const int begin = partOf(count, part), end = partOf(count, part + 1);
      for (int t = begin; t < end; ++t)
        addPieces(mesh, t,
                  (static_cast<std::uint32_t>(object) << 24) | static_cast<std::uint32_t>(t),
                  pieces[part]);
    }
#pragma omp for schedule(dynamic, 1)
    for (int band = 0; band < kBands; ++band) {
      for (const auto& part : pieces) {
        for (const Piece& piece : part) {
          if (piece.tile % kBands != band) continue;
          const int* slots = &slots_[static_cast<std::size_t>(piece.tile) * kTile * kTile];
          kernels().drawSamples(piece.samples, {piece.u, piece.v, piece.wanted, slots}, piece.id,
                                pixels_.data());
        }
      }
    }
  }
}

void EdgeCoverage::addPieces(const ScreenMesh& mesh, int triangle, std::uint32_t id,
                             std::vector<Piece>& pieces) const {
  const Eigen::Vector3i& t = (*mesh.triangles)[triangle];
  const float area = signedArea(mesh, t);
  if (mesh.hides(area) || !(std::abs(area) > 1e-9f)) return;
  // From the pixel whose square holds the least coordinate to the one that holds the greatest.
  const float left = static_cast<float>(region_.x), top = static_cast<float>(region_.y);
  const cv::v_float32x4 from_corner(0.5f - left, 0.5f - top, 1.5f - left, 1.5f - top);
  const auto place = [&](int i) { return cv::v_load_low(mesh.points[t[i]].data()); };
  const cv::v_float32x4 a = place(0), b = place(1), c = place(2),
                        corners = cv::v_combine_low(cv::v_min(cv::v_min(a, b), c),
                                                    cv::v_max(cv::v_max(a, b), c)),
                        within = cv::v_min(cv::v_max(corners + from_corner, cv::v_setzero_f32()),
                                           cv::v_setall_f32(1e6f));
  int limits[4];
  cv::v_store(limits, cv::v_trunc(within));
  const int u0 = limits[0], u1 = std::min(limits[2], region_.width) - 1, v0 = limits[1],
            v1 = std::min(limits[3], region_.height) - 1;
  std::optional<TriangleSamples> samples;
  for (int j = v0 / kTile; j <= v1 / kTile && v0 <= v1; ++j) {
    for (int i = u0 / kTile; i <= u1 / kTile && u0 <= u1; ++i) {
      const int tile = tiles_[static_cast<std::size_t>(j) * tiles_across_ + i];
      if (tile < 0) continue;
      const int u = i * kTile, v = j * kTile;
      const std::uint64_t wanted =
          chosen_[tile] & pixelsWithin(std::max(u0 - u, 0), std::max(v0 - v, 0),
                                       std::min(u1 - u, kTile - 1), std::min(v1 - v, kTile - 1));
      if (wanted == 0) continue;
      if (!samples) samples = samplesOf(mesh, t, area, region_.tl());
      pieces.push_back({*samples, wanted, u, v, tile, id});
    }
  }
}

const EdgeCoverage::Pixel* EdgeCoverage::at(int u, int v) const {
  u -= region_.x, v -= region_.y;
  if (u < 0 || v < 0 || u >= region_.width || v >= region_.height) return nullptr;
  const int slot = slotAt(u, v);
  return slot < 0 ? nullptr : &pixels_[slot];
}

void EdgeCoverage::settle(const VisibilityBuffer& centre) {
  const int down = static_cast<int>(tiles_.size()) / tiles_across_;
#pragma omp parallel for schedule(dynamic, 2)
  for (int j = 0; j < down; ++j) {
    for (int i = 0; i < tiles_across_; ++i) {
      const int tile = tiles_[static_cast<std::size_t>(j) * tiles_across_ + i];
      if (tile < 0) continue;
      int* slots = &slots_[static_cast<std::size_t>(tile) * kTile * kTile];
      for (std::uint64_t rest = chosen_[tile]; rest != 0; rest &= rest - 1) {
        const int k = __builtin_ctzll(rest);
        if (agree(pixels_[slots[k]], centre.ids(j * kTile + k / kTile)[i * kTile + k % kTile]))
          slots[k] = kSettled;
      }
    }
  }
}

}  // namespace calipso::render

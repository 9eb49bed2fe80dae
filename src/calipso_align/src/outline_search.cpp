#include "outline_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace calipso::align {

Feature featureOf(const Eigen::Vector2d& pixel, const Eigen::Vector2d& normal, double scale) {
  return {static_cast<float>(pixel.x()), static_cast<float>(pixel.y()),
          static_cast<float>(scale * normal.x()), static_cast<float>(scale * normal.y())};
}

OutlineSearch::OutlineSearch(const std::vector<Feature>& candidates, float reject_px,
                             float reject_turn)
    : reject_(reject_px * reject_px), reject_turn_(reject_turn) {
  constexpr float kPerCell = 2.0f, kFar = std::numeric_limits<float>::max();
  float u1 = -kFar, v1 = -kFar;
  u0_ = v0_ = kFar;
  for (const Feature& f : candidates) {
    if (std::isnan(f.u)) continue;
    u0_ = std::min(u0_, f.u), u1 = std::max(u1, f.u);
    v0_ = std::min(v0_, f.v), v1 = std::max(v1, f.v);
  }
  if (u1 < u0_) return;
  // Outlines are curves: cells as long as a few of their points are apart.
  const float length = (u1 - u0_) + (v1 - v0_);
  cell_px_ = std::max({1.0f, length / 256.0f, kPerCell * length / candidates.size()});
  columns_ = static_cast<int>((u1 - u0_) / cell_px_) + 1;
  rows_ = static_cast<int>((v1 - v0_) / cell_px_) + 1;

  const auto cellOf = [&](const Feature& f) {
    return static_cast<int>((f.v - v0_) / cell_px_) * columns_ +
           static_cast<int>((f.u - u0_) / cell_px_);
  };
  start_.assign(columns_ * rows_ + 1, 0);
  for (const Feature& f : candidates) {
    if (!std::isnan(f.u)) ++start_[cellOf(f) + 1];
  }
  for (size_t c = 1; c < start_.size(); ++c) start_[c] += start_[c - 1];
  std::vector<int> next(start_.begin(), start_.end() - 1);
  features_.resize(candidates.size());
  index_.resize(candidates.size());
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (std::isnan(candidates[i].u)) continue;
    const int place = next[cellOf(candidates[i])]++;
    features_[place] = candidates[i];
    index_[place] = static_cast<int>(i);
  }
}

void OutlineSearch::searchCell(int column, int row, const Feature& a, Best& best) const {
  const int cell = row * columns_ + column;
  for (int k = start_[cell]; k < start_[cell + 1]; ++k) {
    const Feature& b = features_[k];
    const float distance = (a.u - b.u) * (a.u - b.u) + (a.v - b.v) * (a.v - b.v);
    const float turn = (a.nu - b.nu) * (a.nu - b.nu) + (a.nv - b.nv) * (a.nv - b.nv);
    if (!(distance < reject_ && turn < reject_turn_)) continue;
    const float sum = distance + turn;
    if (sum < best.squared_distance || (sum == best.squared_distance && index_[k] < best.index)) {
      best = {sum, index_[k]};
    }
  }
}

int OutlineSearch::nearest(const Feature& query) const {
  Best best{std::numeric_limits<float>::max(), -1};
  if (features_.empty() || std::isnan(query.u)) return -1;
  const float x = (query.u - u0_) / cell_px_, y = (query.v - v0_) / cell_px_;
  const int column = static_cast<int>(std::floor(std::clamp(x, -1e6f, 1e6f)));
  const int row = static_cast<int>(std::floor(std::clamp(y, -1e6f, 1e6f)));
  // Rings of cells around the query's: all that ring r holds is at least r - 1 cells away.
  const int first = std::max({0, -column, column - columns_ + 1, -row, row - rows_ + 1});
  const int last = std::max({column, columns_ - 1 - column, row, rows_ - 1 - row});
  for (int r = first; r <= last; ++r) {
    const float clear = std::max(0, r - 1) * cell_px_;
    if (clear * clear > std::min(best.squared_distance, reject_)) break;
    const int left = std::max(0, column - r), right = std::min(columns_ - 1, column + r);
    for (int j = std::max(0, row - r); j <= std::min(rows_ - 1, row + r); ++j) {
      const bool full = j == row - r || j == row + r;
      if (full) {
        for (int i = left; i <= right; ++i) searchCell(i, j, query, best);
        continue;
      }
      if (column - r >= 0) searchCell(column - r, j, query, best);
      if (column + r < columns_) searchCell(column + r, j, query, best);
    }
  }
  return best.index;
}

}  // namespace calipso::align

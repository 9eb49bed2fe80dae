#include "texture/bent_shape.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

constexpr float kCells = 64.0f;  // along the extent
constexpr std::size_t kMostSamples = 60000;

// Edges of a triangle, and as third a normal as long as they are.
Eigen::Matrix3f frameOf(const Points& p, const Eigen::Vector3i& t) {
  Eigen::Matrix3f frame;
  frame << p[t[1]] - p[t[0]], p[t[2]] - p[t[0]], Eigen::Vector3f::Zero();
  const Eigen::Vector3f across = frame.col(0).cross(frame.col(1));
  frame.col(2) = across / std::sqrt(std::max(across.norm(), 1e-20f));
  return frame;
}

}  // namespace

BentShape::BentShape(const Points& from, const Points& to, const Triangles& triangles,
                     const std::vector<int>& parts)
    : from_(from), to_(to), triangles_(triangles), parts_(parts) {
  const Eigen::AlignedBox3f box = boxOf(from);
  side_ = std::max(box.diagonal().norm() / kCells, 1e-9f);
  corner_ = box.min() - Eigen::Vector3f::Constant(side_);
  cells_ = cellOf(box.max()) + Eigen::Vector3i::Constant(2);
  for (const Eigen::Vector3i& t : triangles)
    along_.push_back(frameOf(to, t) * frameOf(from, t).inverse());
  const SurfaceTexture texture(from, triangles, side_, kMostSamples);
  std::vector<Sample> samples;
  for (int t = 0; t < texture.triangleCount(); ++t) {
    if (!along_[t].allFinite() || along_[t].determinant() == 0.0f) continue;
    for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
      const Eigen::Vector3f w = texture.weightsOf(t, i - texture.firstOf(t));
      const Eigen::Vector3i& c = triangles[t];
      samples.push_back({w[0] * from[c[0]] + w[1] * from[c[1]] + w[2] * from[c[2]], t});
    }
  }
  // Sorted by cells (counting sort).
  ends_.assign(static_cast<std::size_t>(cells_.cast<long>().prod()) + 1, 0);
  for (const Sample& s : samples) ++ends_[indexOf(cellOf(s.point)) + 1];
  for (std::size_t i = 1; i < ends_.size(); ++i) ends_[i] += ends_[i - 1];
  samples_.resize(samples.size());
  for (const Sample& s : samples) samples_[ends_[indexOf(cellOf(s.point))]++] = s;
}

Eigen::Vector3i BentShape::cellOf(const Eigen::Vector3f& x) const {
  return ((x - corner_) / side_).array().floor().cast<int>();
}

std::size_t BentShape::indexOf(const Eigen::Vector3i& cell) const {
  return cell.x() + static_cast<std::size_t>(cells_.x()) * (cell.y() + cells_.y() * cell.z());
}

int BentShape::nearestTriangle(const Place& place) const {
  const Eigen::Vector3f& x = place.point;
  const Eigen::Array3f in_cells = (x - corner_) / side_;
  if (!((in_cells >= 1.0f).all() && (in_cells < cells_.cast<float>().array() - 1.0f).all()))
    return -1;
  const Eigen::Vector3i cell = cellOf(x);
  int nearest = -1;
  float least = side_ * side_;
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      const std::size_t row = indexOf(cell + Eigen::Vector3i(-1, dy, dz));
      for (std::size_t i = row == 0 ? 0 : ends_[row - 1]; i < ends_[row + 2]; ++i) {
        const float away = (samples_[i].point - x).squaredNorm();
        const int t = samples_[i].triangle;
        if (away < least && (place.part == kAnyPart || place.part == parts_[t]))
          least = away, nearest = t;
      }
    }
  }
  return nearest;
}

std::optional<Place> BentShape::operator()(const Place& place) const {
  const int t = nearestTriangle(place);
  if (t < 0) return std::nullopt;
  const Eigen::Vector3i& c = triangles_[t];
  Place there = place;
  there.point = to_[c[0]] + along_[t] * (place.point - from_[c[0]]);
  there.normal = (along_[t].inverse().transpose() * place.normal).normalized();
  return there;
}

}  // namespace calipso::render

#include "texture/like_texels.hpp"

#include <algorithm>
#include <utility>

namespace calipso::render {
namespace {

constexpr float kSameFace = 0.8f;  // cosine between normals
constexpr float kAsOpen = 0.06f;   // of the sky that a texel may have less of
constexpr int kCellBits = 21, kMiddle = 1 << (kCellBits - 1);

bool isOf(const Place& place, const Place& texel) {
  return (place.part == kAnyPart || place.part == texel.part) &&
         (place.piece == kAnyPart || place.piece == texel.piece) &&
         place.normal.dot(texel.normal) >= kSameFace && place.open - texel.open <= kAsOpen;
}

}  // namespace

KnownTexels::KnownTexels(std::vector<Texel> texels, float reach)
    : texels_(std::move(texels)), reach_(reach) {
  cells_.reserve(texels_.size());
  for (std::size_t i = 0; i < texels_.size(); ++i)
    cells_.push_back({keyOf(cellOf(texels_[i].place.point)), static_cast<std::uint32_t>(i)});
  std::sort(cells_.begin(), cells_.end());
}

std::optional<cv::Vec3f> KnownTexels::at(const Place& place) const {
  const Eigen::Vector3i cell = cellOf(place.point);
  const Texel* nearest = nullptr;
  float least = reach_ * reach_;
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      // The three cells along x follow each other.
      const std::uint64_t first = keyOf(cell + Eigen::Vector3i(-1, dy, dz));
      auto it = std::lower_bound(cells_.begin(), cells_.end(), std::make_pair(first, 0u));
      for (; it != cells_.end() && it->first <= first + 2; ++it) {
        const Texel& texel = texels_[it->second];
        const float away = (texel.place.point - place.point).squaredNorm();
        if (away < least && isOf(place, texel.place)) least = away, nearest = &texel;
      }
    }
  }
  return nearest != nullptr ? std::optional<cv::Vec3f>(nearest->colour) : std::nullopt;
}

Eigen::Vector3i KnownTexels::cellOf(const Eigen::Vector3f& x) const {
  const Eigen::Vector3f& origin = texels_.front().place.point;
  return ((x - origin) / reach_)
      .array()
      .floor()
      .cwiseMax(2.0f - kMiddle)
      .cwiseMin(kMiddle - 2.0f)
      .cast<int>();
}

std::uint64_t KnownTexels::keyOf(const Eigen::Vector3i& cell) const {
  const auto bits = [](int c) { return static_cast<std::uint64_t>(c + kMiddle); };
  return (bits(cell.z()) << (2 * kCellBits)) | (bits(cell.y()) << kCellBits) | bits(cell.x());
}

}  // namespace calipso::render

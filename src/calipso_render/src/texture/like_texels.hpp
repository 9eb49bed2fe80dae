#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "texture/sightings.hpp"

namespace calipso::render {

// Texels whose colours are known, to be found by place.
class KnownTexels {
 public:
  struct Texel {
    Place place;  // with the part and the piece that it is of
    cv::Vec3f colour;
  };

  // @param texels at least one @param reach m: a place's look is that of the nearest within it
  KnownTexels(std::vector<Texel> texels, float reach);

  // Nothing where no known texel of the same face is near, or less of the sky is open to it.
  std::optional<cv::Vec3f> at(const Place& place) const;

 private:
  Eigen::Vector3i cellOf(const Eigen::Vector3f& x) const;
  std::uint64_t keyOf(const Eigen::Vector3i& cell) const;

  std::vector<Texel> texels_;
  float reach_;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> cells_;  // sorted; their texels
};

}  // namespace calipso::render

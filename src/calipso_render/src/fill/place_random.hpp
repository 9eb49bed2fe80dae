#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// Remainders of 16-bit numbers as division leaves them, without one (Lemire, Kaser & Kurz 2019).
class Divisor {
 public:
  explicit Divisor(std::uint32_t value) : value_(value), inverse_(0xffffffffu / value + 1) {}
  std::uint32_t rest(std::uint32_t number) const {
    return static_cast<std::uint32_t>(std::uint64_t{inverse_ * number} * value_ >> 32);
  }

 private:
  std::uint32_t value_, inverse_;
};

// Random numbers that hang on place, use and sweep alone: in whatever order and on however many
// threads they are asked for, they are the same.
class PlaceRandom {
 public:
  // @param farthest px: of offsets, at most
  PlaceRandom(std::uint32_t seed, int farthest) : seed_(seed) {
    for (int reach = 0; reach <= farthest; ++reach) sides_.emplace_back(2 * reach + 1);
  }

  std::uint32_t number(const cv::Point& p, int salt, int sweep) const {
    std::uint32_t h = seed_ * 0x9e3779b9u ^ static_cast<std::uint32_t>(p.x) * 0x85ebca6bu ^
                      static_cast<std::uint32_t>(p.y) * 0xc2b2ae35u ^
                      static_cast<std::uint32_t>(salt + 2048 * sweep) * 0x27d4eb2fu;
    h ^= h >> 15, h *= 0x2c1b3c6du, h ^= h >> 12, h *= 0x297a2d39u, h ^= h >> 15;
    return h;
  }

  // Up to `reach` px along either axis.
  cv::Point offset(const cv::Point& p, int salt, int sweep, int reach) const {
    const std::uint32_t h = number(p, 1024 + salt, sweep);
    return {static_cast<int>(sides_[reach].rest(h & 0xffff)) - reach,
            static_cast<int>(sides_[reach].rest(h >> 16)) - reach};
  }

 private:
  std::uint32_t seed_;
  std::vector<Divisor> sides_;  // by reach: how many places there are along an axis
};

}  // namespace calipso::render

#pragma once

#include <cstdint>
#include <cstring>

namespace calipso::render {

// Eight bytes at once, the first of them lowest, as all processors of today have it.

// First place from `i` on whose byte has a bit of `mask`.
template <class Byte>
int nextMarked(const Byte* bytes, int i, int end, std::uint8_t mask = 0xff) {
  static_assert(sizeof(Byte) == 1);
  const std::uint64_t eight_masks = mask * 0x0101010101010101ull;
  for (std::uint64_t eight; i + 8 <= end; i += 8) {
    std::memcpy(&eight, bytes + i, 8);
    if ((eight & eight_masks) != 0) return i + __builtin_ctzll(eight & eight_masks) / 8;
  }
  while (i < end && (bytes[i] & mask) == 0) ++i;
  return i;
}

// First place from `i` on whose byte has none of them.
template <class Byte>
int nextUnmarked(const Byte* bytes, int i, int end, std::uint8_t mask) {
  static_assert(sizeof(Byte) == 1);
  constexpr std::uint64_t kOnes = 0x0101010101010101ull;
  for (std::uint64_t eight; i + 8 <= end; i += 8) {
    std::memcpy(&eight, bytes + i, 8), eight &= mask * kOnes;
    const std::uint64_t none = (eight - kOnes) & ~eight & (kOnes << 7);  // the lowest is right
    if (none != 0) return i + __builtin_ctzll(none) / 8;
  }
  while (i < end && (bytes[i] & mask) != 0) ++i;
  return i;
}

}  // namespace calipso::render

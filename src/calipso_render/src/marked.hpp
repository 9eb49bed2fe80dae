#pragma once

#include <cstdint>
#include <cstring>

namespace calipso::render {

// First place from `i` on whose byte has a bit of `mask`.
template <class Byte>
int nextMarked(const Byte* bytes, int i, int end, std::uint8_t mask = 0xff) {
  static_assert(sizeof(Byte) == 1);
  const std::uint64_t eight_masks = mask * 0x0101010101010101ull;
  for (std::uint64_t eight; i + 8 <= end; i += 8) {
    std::memcpy(&eight, bytes + i, 8);
    if ((eight & eight_masks) != 0) break;
  }
  while (i < end && (bytes[i] & mask) == 0) ++i;
  return i;
}

}  // namespace calipso::render

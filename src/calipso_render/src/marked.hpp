#pragma once

#include <cstdint>
#include <cstring>

namespace calipso::render {

// First place from `i` on whose byte is not 0.
template <class Byte>
int nextMarked(const Byte* bytes, int i, int end) {
  static_assert(sizeof(Byte) == 1);
  for (std::uint64_t eight; i + 8 <= end; i += 8) {
    std::memcpy(&eight, bytes + i, 8);
    if (eight != 0) break;
  }
  while (i < end && bytes[i] == 0) ++i;
  return i;
}

}  // namespace calipso::render

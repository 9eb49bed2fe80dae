#pragma once

// Eight lanes of one kind, for the bodies of the kernels: see kernels.hpp.

#include <cmath>
#include <cstdint>
#include <cstring>

namespace calipso::render {

typedef float Eight __attribute__((vector_size(32), aligned(4), may_alias));
typedef float Four __attribute__((vector_size(16), aligned(4), may_alias));
typedef std::int32_t EightInts __attribute__((vector_size(32), aligned(4), may_alias));
typedef std::int32_t FourInts __attribute__((vector_size(16), aligned(4), may_alias));
typedef std::int32_t LaneChoice __attribute__((vector_size(32)));

#define CALIPSO_INLINE inline __attribute__((always_inline))

CALIPSO_INLINE Eight& eightAt(float* at) { return *reinterpret_cast<Eight*>(at); }
CALIPSO_INLINE const Eight& eightAt(const float* at) { return *reinterpret_cast<const Eight*>(at); }
CALIPSO_INLINE const Four& fourAt(const float* at) { return *reinterpret_cast<const Four*>(at); }

CALIPSO_INLINE Eight all(float x) { return x - Eight{}; }  // adding to 0 would have to be done
CALIPSO_INLINE Eight larger(const Eight& a, const Eight& b) { return a > b ? a : b; }
CALIPSO_INLINE Eight smaller(const Eight& a, const Eight& b) { return a < b ? a : b; }
CALIPSO_INLINE Eight lanes() { return Eight{0.0f, 1.0f, 2.0f, 3.0f, 4.0f, 5.0f, 6.0f, 7.0f}; }

// Sum in a fixed order, whatever the width of a register.
CALIPSO_INLINE float sumOf(const Eight& x) {
  return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

// @param mask 0 or -1 in each lane
CALIPSO_INLINE bool any(const EightInts& mask) {
  typedef std::int64_t Halves __attribute__((vector_size(32)));
  const Halves h = (Halves)mask;
  return ((h[0] | h[1]) | (h[2] | h[3])) != 0;
}

CALIPSO_INLINE bool any(const FourInts& mask) {
  typedef std::int64_t Halves __attribute__((vector_size(16)));
  const Halves h = (Halves)mask;
  return (h[0] | h[1]) != 0;
}

// A bit for each lane, the first lowest. @param mask 0 or -1 in each lane
CALIPSO_INLINE unsigned bitsOf(const EightInts& mask) {
  typedef std::uint64_t Halves __attribute__((vector_size(32)));
  const Halves h = (Halves)(mask & EightInts{1, 2, 4, 8, 16, 32, 64, 128});
  const std::uint64_t both = (h[0] | h[1]) | (h[2] | h[3]);
  return static_cast<unsigned>(both | both >> 32);
}

// How many of the first lanes are set. @param mask 0 or -1 in each lane
CALIPSO_INLINE int leadingLanes(const EightInts& mask) {
  return __builtin_ctz(bitsOf(~mask) | 256);
}

typedef std::uint8_t EightBytes __attribute__((vector_size(8)));

CALIPSO_INLINE EightInts toInts(const EightBytes& bytes) {
  typedef std::uint64_t Halves __attribute__((vector_size(32)));
  typedef std::uint8_t Bytes __attribute__((vector_size(32)));
  const Bytes all_bytes = (Bytes)(Halves{} + (std::uint64_t)bytes);
  return (EightInts)__builtin_shuffle(
             all_bytes, Bytes{0,  0,  0,  0,  1,  1,  1,  1,  2,  2,  2,  2,  3,  3,  3,  3,
                              20, 20, 20, 20, 21, 21, 21, 21, 22, 22, 22, 22, 23, 23, 23, 23}) &
         0xff;
}

// @pre in [0, 255]
CALIPSO_INLINE EightBytes toBytes(const EightInts& ints) {
  typedef std::uint8_t Bytes __attribute__((vector_size(32)));
  const EightInts fours = (EightInts)__builtin_shuffle(
      (Bytes)ints, Bytes{0,  4,  8,  12, 0,  4,  8,  12, 0,  4,  8,  12, 0,  4,  8,  12,
                         16, 20, 24, 28, 16, 20, 24, 28, 16, 20, 24, 28, 16, 20, 24, 28});
  return (EightBytes)(static_cast<std::uint32_t>(fours[0]) |
                      std::uint64_t{static_cast<std::uint32_t>(fours[4])} << 32);
}

CALIPSO_INLINE Eight squareRoot(const Eight& x) {
  Eight root;
  for (int k = 0; k < 8; ++k) root[k] = std::sqrt(x[k]);
  return root;
}

}  // namespace calipso::render

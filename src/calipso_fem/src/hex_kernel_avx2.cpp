#include <type_traits>

#include "hex_kernel.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#define CALIPSO_HEX_AVX
#pragma GCC target("avx2,fma")
#endif

namespace calipso::fem::avx2 {
#include "hex_kernel/kernel.inl"
}  // namespace calipso::fem::avx2

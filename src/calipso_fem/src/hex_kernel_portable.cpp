#include <type_traits>

#include "hex_kernel.hpp"

namespace calipso::fem::portable {
#include "hex_kernel/kernel.inl"
}  // namespace calipso::fem::portable

namespace calipso::fem {

const HexKernel& hexKernel() {
#if defined(__x86_64__)
  static const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  static const bool has_avx512 =
      has_avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
  if (has_avx512) return avx512::kHexKernel;
  if (has_avx2) return avx2::kHexKernel;
#endif
  return portable::kHexKernel;
}

}  // namespace calipso::fem

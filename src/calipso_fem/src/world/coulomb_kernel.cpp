#include "coulomb_kernel.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace calipso::fem {
namespace {

namespace portable {
#define TARGET
#include "coulomb_kernel.inl"
#undef TARGET
}  // namespace portable

#if defined(__x86_64__)
namespace avx2 {
#define TARGET __attribute__((target("avx2,fma")))
#include "coulomb_kernel.inl"
#undef TARGET
}  // namespace avx2

const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#endif

}  // namespace

double sweepRows(RigidRows& rows) {
#if defined(__x86_64__)
  if (has_avx2) return avx2::sweepRows(rows);
#endif
  return portable::sweepRows(rows);
}

}  // namespace calipso::fem

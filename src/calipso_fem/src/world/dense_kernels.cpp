#include "dense_kernels.hpp"

namespace calipso::fem {
namespace {

namespace portable {
#define TARGET
#include "dense_kernels.inl"
#undef TARGET
}  // namespace portable

#if defined(__x86_64__)
namespace avx2 {
#define TARGET __attribute__((target("avx2,fma")))
#include "dense_kernels.inl"
#undef TARGET
}  // namespace avx2

const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#endif

}  // namespace

void addThree(const double* x, long stride, const double a[3], int n, double* y) {
#if defined(__x86_64__)
  if (has_avx2) return avx2::addThree(x, stride, a, n, y);
#endif
  portable::addThree(x, stride, a, n, y);
}

void projectOnto(const PlaceList& places, int count, const double* columns, double* out) {
#if defined(__x86_64__)
  if (has_avx2) return avx2::projectOnto(places, count, columns, out);
#endif
  portable::projectOnto(places, count, columns, out);
}

}  // namespace calipso::fem

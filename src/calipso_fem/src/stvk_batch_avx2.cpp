#include "stvk_batch.hpp"

#if defined(__x86_64__)
#pragma GCC target("avx2,fma")
#endif

namespace calipso::fem::avx2 {
#include "stvk_batch_kernel.inl"
}  // namespace calipso::fem::avx2

#include "stvk_batch.hpp"

namespace calipso::fem {
namespace portable {
#include "stvk_batch_kernel.inl"
}  // namespace portable

void evaluateStvkBatch(const StvkBatchKind& kind, const double x[24][kLanes], int derivatives,
                       StvkPart part, StvkBatchResult* result) {
  static const bool fast = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  (fast ? avx2::evaluateStvkBatch : portable::evaluateStvkBatch)(kind, x, derivatives, part,
                                                                 result);
}

}  // namespace calipso::fem

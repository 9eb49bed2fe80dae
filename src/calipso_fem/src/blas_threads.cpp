#include "calipso_fem/blas_threads.hpp"

// Weak: another BLAS may stand behind CHOLMOD.
extern "C" void openblas_set_num_threads(int threads) __attribute__((weak));

namespace calipso::fem {

void useOneBlasThread() {
  if (openblas_set_num_threads) openblas_set_num_threads(1);
}

}  // namespace calipso::fem

#include "threads.hpp"

#include <omp.h>

// Weak: another BLAS may stand behind CHOLMOD.
extern "C" void openblas_set_num_threads(int threads) __attribute__((weak));

namespace calipso::fem {

void setThreads(int threads) {
  omp_set_num_threads(threads);
  if (openblas_set_num_threads) openblas_set_num_threads(1);
}

}  // namespace calipso::fem

#include "threads.hpp"

#include <omp.h>

#include <atomic>

// Weak: another BLAS may stand behind CHOLMOD.
extern "C" void openblas_set_num_threads(int threads) __attribute__((weak));

namespace calipso::fem {
namespace {

std::atomic<int> thread_count{2};

}  // namespace

void setThreads(int threads) {
  thread_count = threads;
  omp_set_num_threads(threads);
  if (openblas_set_num_threads) openblas_set_num_threads(1);
}

int threadCount() { return thread_count; }

}  // namespace calipso::fem

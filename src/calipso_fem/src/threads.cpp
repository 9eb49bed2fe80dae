#include "threads.hpp"

#include <omp.h>

#include <atomic>

namespace calipso::fem {
namespace {

std::atomic<int> thread_count{2};

}  // namespace

void setThreads(int threads) {
  thread_count = threads;
  omp_set_num_threads(threads);
}

int threadCount() { return thread_count; }

}  // namespace calipso::fem

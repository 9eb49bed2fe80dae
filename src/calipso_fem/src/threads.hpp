#pragma once

namespace calipso::fem {

// Threads of the finite element loops (runParallel). BLAS inside CHOLMOD gets one thread, since
// CHOLMOD's small supernodes lose more by waking threads than they gain.
void setThreads(int threads);
int threadCount();

}  // namespace calipso::fem

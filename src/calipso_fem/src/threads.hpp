#pragma once

namespace calipso::fem {

// Threads of the finite element loops (runParallel).
void setThreads(int threads);
int threadCount();

}  // namespace calipso::fem

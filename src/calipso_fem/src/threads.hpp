#pragma once

namespace calipso::fem {

// OpenMP threads of the element loops; BLAS inside CHOLMOD gets one thread, since CHOLMOD's small
// supernodes lose more by waking threads than they gain.
void setThreads(int threads);

}  // namespace calipso::fem

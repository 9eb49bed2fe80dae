#pragma once

namespace calipso::fem {

// BLAS behind CHOLMOD works with one thread from now on; called before every factorisation's first.
// With more, the order of its sums hangs on the number of processors, and CHOLMOD's small
// supernodes lose more by waking threads than they gain.
void useOneBlasThread();

}  // namespace calipso::fem

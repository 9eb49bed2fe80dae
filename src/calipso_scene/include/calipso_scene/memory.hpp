#pragma once

#include <malloc.h>

namespace calipso {

// Keeps what is freed for the process; to be called first of all. Pictures of some MB come and go
// by the hundred; given back to the kernel, as glibc does, every page of the next one is mapped and
// cleared anew.
inline void keepFreedMemory() {
  constexpr int kMegabyte = 1 << 20;
  mallopt(M_MMAP_THRESHOLD, 32 * kMegabyte);  // the largest that glibc takes
  mallopt(M_TRIM_THRESHOLD, 256 * kMegabyte);
}

}  // namespace calipso

#pragma once

// For functions whose loops over bytes are worth compiling for AVX2, too: the better one is chosen
// when the program is loaded. Both give the same bits.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define CALIPSO_WIDE_LOOPS __attribute__((target_clones("avx2", "default")))
#else
#define CALIPSO_WIDE_LOOPS
#endif

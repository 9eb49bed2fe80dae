#pragma once

// Before a function: compiled for the processors that the build is for and for those with AVX2 and
// FMA, chosen when the program starts. Inline functions that it calls must be always_inline. The
// clones' results may differ in the last bit.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define CALIPSO_CLONES __attribute__((target_clones("default", "arch=haswell")))
#else
#define CALIPSO_CLONES
#endif

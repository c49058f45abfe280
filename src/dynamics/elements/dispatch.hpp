/// \file
/// ESPALIER_CLONES: the function (with all that it inlines) is compiled for AVX-512, AVX2 and the baseline, and the
/// machine picks when the program is loaded. Left out under sanitizers (their start-up does not support ifuncs) and
/// for compilers without the attribute.
#pragma once

#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define ESPALIER_CLONES __attribute__((target_clones("arch=skylake-avx512", "arch=haswell", "default")))
#define ESPALIER_INLINE inline __attribute__((always_inline))
#else
#define ESPALIER_CLONES
#define ESPALIER_INLINE inline
#endif

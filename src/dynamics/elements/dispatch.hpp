/// \file
/// ESPALIER_CLONES: the function (with all that it inlines) is compiled for AVX2 and the baseline, and the machine
/// picks by its features when the program is loaded; by names of processors, newer ones would get the baseline. Not for
/// AVX-512, of which GCC 13.3 makes wrong code (src/CMakeLists.txt). Left out under sanitizers (their start-up does not
/// support ifuncs), for compilers without the attribute, and with ESPALIER_NO_CLONES (a test of what the baseline
/// computes).
#pragma once

#if defined(__GNUC__) && __GNUC__ >= 12 && !defined(__clang__) && defined(__x86_64__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && !defined(ESPALIER_NO_CLONES)
#define ESPALIER_CLONES __attribute__((target_clones("arch=x86-64-v3", "default")))
#define ESPALIER_INLINE inline __attribute__((always_inline))
#else
#define ESPALIER_CLONES
#define ESPALIER_INLINE inline
#endif

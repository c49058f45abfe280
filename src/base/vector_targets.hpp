/// \file
/// The instruction sets that kernels are compiled for, one after the other: AVX-512, AVX2, NEON, and what every
/// processor of the family has. Each takes as long to compile as the others; a processor without AVX2 is ten years old.
/// Scalable vectors cannot stand in arrays. To be included before Highway.
#pragma once

#define HWY_DISABLED_TARGETS                                                                                   \
  (HWY_AVX3_DL | HWY_SSE4 | HWY_SSSE3 | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV | HWY_PPC8 | \
   HWY_WASM | HWY_WASM_EMU256)

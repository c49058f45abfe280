/// \file
/// ESPALIER_ANYWHERE: a function of numbers alone, which the host calls and kernels on GPUs call.
#pragma once

#ifdef __CUDACC__
#define ESPALIER_ANYWHERE __host__ __device__
#else
#define ESPALIER_ANYWHERE
#endif

/// Kernels call this function and do not inline it: their code would be more than a compiler can bear.
#define ESPALIER_APART ESPALIER_ANYWHERE
/// Before a loop that kernels do not unroll, for the same reason.
#define ESPALIER_ROLLED

/// \file
/// ESPALIER_ANYWHERE: a function of numbers alone, which the host calls and kernels on GPUs call.
#pragma once

#ifdef __CUDACC__
#define ESPALIER_ANYWHERE __host__ __device__
#else
#define ESPALIER_ANYWHERE
#endif

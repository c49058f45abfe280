/// \file
/// What stands before the tasks of a factorization that makes some fronts alone: these become open again, the others
/// stay finished, and the counts of their pivots are taken from D. As plain C++.
#pragma once

#include <cuda_runtime_api.h>

#include "device/cuda/kernels/factor/factor_parameters.hpp"
#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// Pointers are memory that the device reaches. Of several GPUs each opens the fronts in its own flags, and counts
/// those of which it is the first member. @pre all fronts are finished, and none of their pivots was replaced; the
/// counters are zero
template <class T>
struct FactorRenewal {
  const Front* fronts;
  Index count;              ///< of fronts
  const char* made;         ///< fronts; not 0: it is made again
  int parts;                ///< of the flags
  std::int64_t part_flags;  ///< flags of one part
  int* flags;
  int* finished;    ///< fronts
  int* control;     ///< counters
  const T* pivots;  ///< n, then D^-1 as in FactorState (ldlt); null: nothing is counted
  Index n;
  int self;  ///< the GPU's number among those of the plan
};

template <class T>
cudaError_t launch_renewal(const FactorRenewal<T>& job, cudaStream_t stream);

}  // namespace espalier::device::cuda

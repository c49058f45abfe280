/// \file
/// What stands before and after the tasks of a factorization in its graph. On one GPU, control memory is cleared and
/// the pivot rule completed; the pivots are judged, and what the host wants to know goes to its memory. So a
/// factorization is one launch and one wait. Of several GPUs, each takes the values that it needs from the first, which
/// judges all pivots when all have finished. As plain C++.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "device/cuda/kernels/factor/factor_parameters.hpp"
#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// Pointers are device memory but for FactorEnd.
template <class T>
struct FactorBegin {
  int* control;  ///< counters, then what else is to be zero
  Offset control_size;
  unsigned char* marks;  ///< FactorState::replaced and failed
  Offset marks_size;
  T* limits;              ///< FactorState::limits; all but [1] are completed, unless `largest` is not given
  const double* largest;  ///< `parts` numbers; their maximum is the largest magnitude among the values; null: not given
  int parts;
  double tiny, suspect;  ///< limits [0] and [2] over the largest magnitude
};

/// One of several GPUs takes its values. Control memory was cleared after the run before, because others write to it.
template <class T>
struct FactorTake {
  const T* from;  ///< of the first GPU
  T* to;
  Offset values;                ///< their number
  const std::uint32_t* chunks;  ///< what is copied: kValueChunk values from kValueChunk * chunk on
  Offset chunk_count;
  int* control;           ///< counters; kAborted is set when a value is not finite
  T* limits;              ///< as in FactorBegin
  const double* largest;  ///< likewise, in the memory of the first GPU
  int parts;
  double tiny, suspect;  ///< likewise
};

/// Bits of FactorState::replaced. The first is set by the factorization, or by the judge of llt.
enum PivotMark : unsigned char {
  kPivotReplaced = 1,       ///< llt: it counts as zero
  kPivotSmall = 2,          ///< kept, but below limits [2]
  kPivotSmallNegative = 4,  ///< ... and a negative eigenvalue of D
};

/// What the host reads after a factorization: pinned memory that the GPU writes.
struct FactorEnd {
  int counters[kCounters];
  int small;        ///< pivots that the judge has marked
  int sign;         ///< of the product of the pivots: -1, 0, 1
  double mantissa;  ///< |product| = mantissa * 2^exponent; mantissa in [1, 2), zero or not a number
  long long exponent;
  double largest;  ///< maximum of FactorBegin::largest; infinity: some value is not finite, and nothing was done
};

/// A part of the product, by block of threads.
struct PivotProduct {
  double mantissa;
  long long exponent;
  int small;
};

template <class T>
struct FactorJudge {
  Index n;
  const T* pivots[kMostDevices];  ///< n each; ldlt: D^-1 follows them, as in FactorState
  bool pairs;                     ///< ldlt
  const unsigned char* owner;     ///< n; by position: which of them has it; null: the first
  const T* values;
  const Offset* diagonal;  ///< n; by position: place of the diagonal entry among `values`; null: pivots are not judged
  double rounding;         ///< a pivot of at most rounding * its diagonal entry counts as zero
  const T* limits;         ///< FactorState::limits (ldlt, lu; null: llt)
  unsigned char* marks;    ///< n; PivotMark
  const int* control;      ///< counters
  const double* largest;   ///< as in FactorBegin
  int parts;
  PivotProduct* products;  ///< judge_blocks(n)
  int* ticket;             ///< zero, before and after
  FactorEnd* end;          ///< host memory
};

/// Blocks of threads of the judge: products are grouped by it, so it depends on n alone.
int judge_blocks(Index n);

template <class T>
cudaError_t launch_begin(const FactorBegin<T>& job, cudaStream_t stream);
template <class T>
cudaError_t launch_take(const FactorTake<T>& job, cudaStream_t stream);
template <class T>
cudaError_t launch_judge(const FactorJudge<T>& job, cudaStream_t stream);

}  // namespace espalier::device::cuda

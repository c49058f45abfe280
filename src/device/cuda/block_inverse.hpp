/// \file
/// Inverses of whole blocks of pivots, for the solve. As plain C++.
///
/// The factorization leaves the inverse of every diagonal tile, 32 or 64 wide; a solve then passes the 128 pivots of a
/// row block in three to seven products, one after another, while all blocks of the front after it wait. With M1 and M2
/// the inverses of two neighbours and L21 the part of the factor between them,
///
///     inverse([L1 0; L21 L2]) = [M1 0; P M2],  P = -M2 L21 M1,
///
/// P takes the place of L21, which nobody needs any more, and a block costs one product in either direction. Of a front
/// with tiles of 32, pairs become tiles of 64 and these are joined in turn. The same holds for what L U keeps of U,
/// which is U^T, and for L D L^T, where M = inverse(L) P with the tile's permutation.
///
/// Accuracy: to first order, rounding in x2 = M2 (b2 - L21 (M1 b1)) makes errors of at most c n u |M2| (|b2| + |L21|
/// |M1| |b1|), element by element. The computed P^ has |P^ - P| <= c n u |M2| |L21| |M1| (Higham, Accuracy and
/// Stability of Numerical Algorithms, 2nd ed., section 3.5, twice), so x2 = M2 b2 + P^ b1 has the same bound with
/// another c: the products are only associated otherwise. Both are those of substitution by inverted diagonal blocks
/// (ibid., chapter 14); docs/performance.md has backward errors measured before and after.
#pragma once

#include <cuda_runtime_api.h>

#include "device/cuda/factor_parameters.hpp"

namespace espalier::device::cuda {

/// Joins the inverses in row blocks of pivots of fronts with Front::inverted == kRowBlock. All pointers are device
/// memory.
template <class T>
struct BlockInverses {
  const FactorState<T>& state;  ///< after its kernels; of several devices, others may still send parts of the top
  const SolveTask* blocks;
  int count;
  int arrays;  ///< factor arrays that a solve reads: 2 for lu
};

template <class T>
cudaError_t launch_block_inverses(const BlockInverses<T>& job, cudaStream_t stream);

}  // namespace espalier::device::cuda

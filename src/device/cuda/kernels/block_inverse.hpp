/// \file
/// Inverses of whole blocks of pivots, for solves with L L^T. As plain C++.
///
/// The factorization leaves the inverse of every diagonal tile, 32 or 64 wide; a solve then passes the 128 pivots of a
/// row block in three to seven products, one after another, while all blocks of the front after it wait. With M1 and M2
/// the inverses of two neighbours and L21 the part of the factor between them,
///
///     inverse([L1 0; L21 L2]) = [M1 0; P M2],  P = -M2 L21 M1,
///
/// P takes the place of L21, which nobody needs any more, and a block costs one product in either direction. Of a front
/// with tiles of 32, pairs become tiles of 64 and these are joined in turn.
///
/// Accuracy: the computed P^ has |P^ - P| <= c n u |M2| |L21| |M1| (Higham, Accuracy and Stability of Numerical
/// Algorithms, 2nd ed., section 3.5, twice), so errors of x2 = M2 b2 + P^ b1 have the bound, with another c, of those
/// of M2 (b2 - L21 (M1 b1)). Residuals do not: that of M2 (b2 - L21 (M1 b1)) is consistent with the x1 that was
/// computed, that of M2 b2 + P^ b1 is up to |L2| times its error. Where L is bounded, as by the diagonal in L L^T,
/// backward errors stay what they were (docs/notebook/gpu.md, "Solve"). Where pivots are chosen inside tiles alone and
/// entries of L grow, they do not: a random indefinite matrix went from 1.6e-14 to 1.1e-13. So L D L^T and L U keep
/// their tiles, which also saves their refactorizations the time.
#pragma once

#include <cuda_runtime_api.h>

#include "device/cuda/kernels/factor/factor_parameters.hpp"

namespace espalier::device::cuda {

/// Joins the inverses in row blocks of pivots, those of fronts with Front::inverted == kRowBlock. blocks: device
/// memory.
/// @param state  after its kernels; of several devices, others may still send parts of the top
template <class T>
cudaError_t launch_block_inverses(const FactorState<T>& state, const SolveTask* blocks, int count, cudaStream_t stream);

}  // namespace espalier::device::cuda

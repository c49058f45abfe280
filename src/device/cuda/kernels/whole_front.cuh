/// \file
/// A whole small front, in shared memory, after its pivot block has been inverted.
#pragma once

#include "device/cuda/kernels/diagonal_lu.cuh"
#include "device/cuda/kernels/half_products.cuh"

namespace espalier::device::cuda {

/// out = in M^T for the strip of 16 rows at `strip` (element (r, k) at strip[r * sr + k * sk]), in place, by one warp.
template <class T>
__device__ void strip_times_inverse(T* strip, int sr, int sk, const T* m, int ldm, int size) {
  T c[8][4] = {};
#pragma unroll
  for (int n = 0; n < 8; ++n)
    if (8 * n < size)
      for (int k = 0; k < size; k += 16) multiply_shared(c[n], strip + k * sk, sr, sk, m + k * ldm + 8 * n, ldm, 1);
  __syncwarp();
#pragma unroll
  for (int n = 0; n < 8; ++n)
    if (8 * n < size) put_shared(c[n], T(1), false, strip + 8 * n * sk, sr, sk);
  __syncwarp();
}

/// Writes a whole front's contribution from its scratch tile.
template <class T, Kind K>
__device__ void write_contribution(const FactorState<T>& s, T* base, const Front& f, const T* a, int ld) {
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31, p = f.pivot_pad;
  for (int c = warp; c < f.below; c += 4) {
    T* to = (f.first_place >= 0 ? s.places[f.place(0, 0)] : base + f.contribution) +
            static_cast<std::int64_t>(c) * f.below_ld;
    for (int r = c + lane; r < f.below; r += 32) to[r] = a[(p + c) * ld + p + r];
    if constexpr (K == Kind::lu) {
      T* up = (f.first_place >= 0 ? s.places[f.place(0, 1)] : base + f.contribution_up) +
              static_cast<std::int64_t>(c) * f.below_ld;
      for (int r = c + 1 + lane; r < f.below; r += 32) up[r] = a[(p + r) * ld + p + c];
    }
  }
}

/// A whole small front with symmetric values: its rows below times the transposed inverse M go to the columns to the
/// right of the pivots, transposed: L for llt, L D for ldlt, where L replaces the rows below. Ends with a barrier.
template <class T, Kind K>
__device__ void multiply_below(const FactorState<T>& s, const Front& f, T* a, const T* m) {
  const int warp = static_cast<int>(threadIdx.x) >> 5, lane = static_cast<int>(threadIdx.x) & 31;
  const int p = f.pivot_pad, ld = f.total_pad + 4, ldm = p + 4, below = f.total_pad - p;
  T* low = a + p;
  T* up = a + p * ld;
#pragma unroll 1
  for (int y = warp; y < below / 16 * (p / 8); y += kThreads / 32) {  // fragments of 16 x 8
    const int i = 16 * (y / (p / 8)), n = 8 * (y % (p / 8));
    T c[4] = {};
#pragma unroll 1
    for (int k = 0; k < p; k += 16) multiply_shared(c, low + k * ld + i, 1, ld, m + k * ldm + n, ldm, 1);
    put_shared(c, T(1), false, up + i * ld + n, ld, 1);
  }
  __syncthreads();
  if (K == Kind::llt) return;
  const T* d = a + kInverseD * ld;
  const T* e = a + kInverseE * ld;
  const T bound = s.growth();
  for (int k = warp; k < f.pivots; k += kThreads / 32)
    for (int r = lane; r < below; r += 32) {
      const T l = apply_inverse_d(d, e, k, [&](int c) { return up[r * ld + c]; });
      low[k * ld + r] = l;
      if (r < f.below) check_growth(s, bound, l, f.position + k);
    }
  __syncthreads();
}

/// The rest of a whole small front in shared memory, after its pivot block was inverted: M is the last inverse.
template <class T, Kind K>
__device__ void finish_whole(Workshop<T>& w, const Front& f, const FactorTask& task) {
  const FactorState<T>& s = *w.state;
  const int warp = static_cast<int>(threadIdx.x) >> 5;
  const int p = f.pivot_pad, size = f.total_pad, ld = size + 4, ldm = p + 4, strips = (size - p) / 16;
  T* a = w.pipe.stages;
  const T* m = a + ld * size;
  T* low = a + p;      // rows below, pivot columns: element (r, k) at low[k * ld + r]
  T* up = a + p * ld;  // pivot rows, columns below: element (k, c) at up[c * ld + k]
  __syncthreads();
  if constexpr (K == Kind::lu) {
    for (int i = warp; i < strips; i += 4) strip_times_inverse(low + 16 * i, 1, ld, m, ldm, p);
    __syncthreads();
    const T bound = s.growth();
    for (int k = warp; k < f.pivots; k += 4)
      for (int r = static_cast<int>(threadIdx.x) & 31; r < f.below; r += 32)
        check_growth(s, bound, low[k * ld + r], f.position + k);
  } else {
    multiply_below<T, K>(s, f, a, m);
  }
  const std::int64_t stride = static_cast<std::int64_t>(size) * kChunk;
  if (strips > 0) {
    write_panels(K == Kind::llt ? up : low, K == Kind::llt ? ld : 1, K == Kind::llt ? 1 : ld, size - p, p,
                 array_of(w.base(), f, 0) + f.chunk_offset(0, p), stride);
    if constexpr (K == Kind::lu)
      write_panels(up, ld, 1, size - p, p, array_of(w.base(), f, 1) + f.chunk_offset(0, p), stride);
  }
  // A22 -= A21 B12: L L^T, L (L D)^T or L U.
  for (int y = warp; y < 2 * strips * strips; y += 4) {
    const int h = y & 1, i = 16 * ((y >> 1) / strips), j = 16 * ((y >> 1) % strips) + 8 * h;
    if (K != Kind::lu && j > i + 8) continue;
    T c[4] = {};
#pragma unroll 1
    for (int k = 0; k < p; k += 16)
      multiply_shared(c, K == Kind::llt ? up + i * ld + k : low + k * ld + i, K == Kind::llt ? ld : 1,
                      K == Kind::llt ? 1 : ld, up + j * ld + k, 1, ld);
    put_shared(c, T(-1), true, a + (p + j) * ld + p + i, 1, ld);
  }
  __syncthreads();
  if (f.below > 0) write_contribution<T, K>(s, w.base(), f, a, ld);
  const std::int64_t flag = f.below > 0 ? f.flag(f.pivot_blocks, f.pivot_tiles) : f.diagonal_flag(0);
  finish_task(w, task.front, flag, 0, K == Kind::lu ? s.part_flags : 0, waiting_peers(s, f, true) | pivot_peers(s, f),
              [&](int d) {
                if ((f.members >> d & 1) == 0) return;
                if (f.region == 0)
                  for (int k = 0; k < (K == Kind::lu ? 2 : 1); ++k)
                    copy_to_peer(s, d, array_of(w.base(), f, k), f.factor_size());
                copy_pivots_to_peer<T, K>(s, d, f.position, f.pivots, w.n);
              });
}

}  // namespace espalier::device::cuda

/// \file
/// The tasks that eliminate pivots: diagonal tiles and whole small fronts. Shared memory as in block_tasks.cuh.
#pragma once

#include "device/cuda/kernels/whole_front.cuh"

namespace espalier::device::cuda {

/// Inverses of a diagonal tile's factors, in shared memory: A (size x size) is destroyed, M goes to the factor array,
/// the transposed inverse of U (lu) to the second one. On return m holds the last one written; between the two,
/// use_lower().
template <class T, Kind K, class Use>
__device__ void invert_pivot_block(const FactorState<T>& s, T* base, const Front& f, int col, T* a, int lda, int size,
                                   T* m, int ldm, int n, Use&& use_lower) {
  const int pivots = min(f.pivots - col, size), q = col / kChunk;
  const std::int64_t stride = static_cast<std::int64_t>(f.total_pad - col) * kChunk;
  const PivotSink<T> sink{&s, f.position + col, n};
  if constexpr (K == Kind::llt) {
    for (int x = pivots + static_cast<int>(threadIdx.x); x < size; x += kThreads) a[x * lda + x] = T(1);
    __syncthreads();
    invert_cholesky(a, lda, size, pivots, m, ldm, sink);
  } else if constexpr (K == Kind::ldlt) {
    invert_ldlt(a, lda, size, pivots, m, ldm, sink);
  } else {
    invert_lower_lu(a, lda, size, pivots, m, ldm, sink);
  }
  write_panels(m, 1, ldm, size, size, array_of(base, f, 0) + f.chunk_offset(q, col), stride);
  use_lower();
  if constexpr (K == Kind::lu) {
    __syncthreads();
    invert_upper_lu(a, lda, size, m, ldm);
    write_panels(m, 1, ldm, size, size, array_of(base, f, 1) + f.chunk_offset(q, col), stride);
  }
}

/// The diagonal tile of a pivot column, up to its factorization: what was gathered loses the products to its left.
template <class T, Kind K, bool Half, int Width>
__device__ __forceinline__ void subtract_from_diagonal(Workshop<T>& w, const Front& f, int j) {
  using S = Shape<T, Width, Width>;
  const FactorState<T>& s = *w.state;
  const Corner<S> at;
  const int col = f.column_begin(j), size = f.column_end(j) - col;
  T acc[S::kM][S::kN][4];
  const int a = f.block_of_column(j);
  const int from_a = operand_array<K>(0, 0), from_b = operand_array<K>(0, 1);
  const int* flag_a = s.flags(0) + f.flag(a, 0);
  const int* flag_b = s.flags(K == Kind::lu ? 1 : 0) + f.flag(a, 0);
  const Operand<T> left{array_of(w.base(), f, from_a), col, size}, right{array_of(w.base(), f, from_b), col, size};
  const ChunkSum<T> sum{&f, left, right, K == Kind::llt, col / kChunk, flag_a, flag_b, f.blocks};
  sum_tile<Half, T, S>(acc, w, sum, true, 0, operand_scales<K>(s.largest(), s.growth(), 0));
  T* c = w.pipe.stages;
  for_each_element<S>(at, [&](int m, int n, int e, int r, int k) {
    if (r < size && k < size) c[k * S::kLd + r] = -acc[m][n][e];
  });
  __syncthreads();
}

/// A diagonal tile, or a whole front.
template <class T, Kind K, bool Wide, bool Half>
__device__ __forceinline__ void pivot_task(Workshop<T>& w, const Front& f, const FactorTask& task) {
  const FactorState<T>& s = *w.state;
  const bool whole = task.work == Work::whole;
  const int j = task.column, col = f.column_begin(j), size = f.column_end(j) - col;
  if (!whole) {
    if (Wide && f.width == 64)
      subtract_from_diagonal<T, K, Half, 64>(w, f, j);
    else
      subtract_from_diagonal<T, K, Half, 32>(w, f, j);
  }
  T* a = w.pipe.stages;
  const int lda = whole ? f.total_pad + 4 : f.width + 4, ldm = whole ? size + 4 : f.width + 4;
  T* m = a + lda * (whole ? f.total_pad : f.width);
  invert_pivot_block<T, K>(s, w.base(), f, col, a, lda, size, m, ldm, w.n, [&] {
    if constexpr (K == Kind::lu) {  // U12^T = A12^T P^T inverse(L)^T
      const int strips = whole ? (f.total_pad - size) / 16 : 0;
      for (int i = static_cast<int>(threadIdx.x) >> 5; i < strips; i += 4)
        strip_times_inverse(a + size * lda + 16 * i * lda, lda, 1, m, ldm, size);
    }
  });
  if (whole) {
    finish_whole<T, K>(w, f, task);
    return;
  }
  finish_task(w, task.front, f.diagonal_flag(j), 0, 0, pivot_peers(s, f), [&](int d) {
    const std::int64_t stride = static_cast<std::int64_t>(f.total_pad - col) * kChunk;
    if (f.region == 0)
      for (int k = 0; k < (K == Kind::lu ? 2 : 1); ++k)
        for (int q = 0; q < size / kChunk; ++q)
          copy_to_peer(s, d, array_of(w.base(), f, k) + f.chunk_offset(col / kChunk, col) + q * stride,
                       static_cast<std::int64_t>(size) * kChunk);
    copy_pivots_to_peer<T, K>(s, d, f.position + col, min(f.pivots - col, size), w.n);
  });
}

}  // namespace espalier::device::cuda

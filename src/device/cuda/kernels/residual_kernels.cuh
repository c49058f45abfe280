/// \file
/// Residuals of op(A) x = b in twice the working precision with what their size is measured against, in one pass over
/// the matrix for up to eight right-hand sides. One: eight threads share a row. Several: a thread has a column, and
/// eight threads fetch the row's entries for each other.
#pragma once

#include "device/cuda/kernels/block_sums.cuh"
#include "device/cuda/kernels/device_pattern.cuh"

namespace espalier::device::cuda {

constexpr int kResidualColumns = 8;  ///< right-hand sides of one pass

/// A sum of products in twice the working precision: TwoProduct by fused multiply-add, TwoSum of Knuth.
struct LongSum {
  double high = 0, low = 0;

  __device__ void add(double x, double error) {
    const double s = __dadd_rn(high, x), z = __dsub_rn(s, high);
    low = __dadd_rn(low, __dadd_rn(__dadd_rn(__dsub_rn(high, __dsub_rn(s, z)), __dsub_rn(x, z)), error));
    high = s;
  }
  __device__ void subtract_product(double a, double b) {
    const double p = __dmul_rn(-a, b);
    add(p, __fma_rn(-a, b, -p));
  }
  __device__ void sum_lanes() {
#pragma unroll
    for (int d = 1; d < kLanes; d *= 2) {
      const double h = __shfl_xor_sync(0xffffffffu, high, d), l = __shfl_xor_sync(0xffffffffu, low, d);
      add(h, l);
    }
  }
};

/// Maxima over the rows that a thread, and finally everybody, has seen.
struct ResidualSizes {
  static constexpr int kCount = 5;
  double of[kCount] = {};  ///< |r|; |r| / (|A| |x| + |b|); |x|; |b|; sums of |op(A)|'s rows. infinity: not finite

  __device__ void add(double residual, double scale, double x, double b, double row) {
    const double size = is_finite(residual) && is_finite(x) ? fabs(residual) : infinity();
    const double relative = scale > 0 ? size / scale : (size == 0 ? 0.0 : infinity());
    of[0] = larger(of[0], size);
    of[1] = larger(of[1], is_finite(size) ? relative : infinity());
    of[2] = larger(of[2], fabs(x));
    of[3] = larger(of[3], fabs(b));
    of[4] = larger(of[4], row);
  }
};

/// What the entries of a row come to.
struct RowSums {
  LongSum residual;
  double scale = 0, norm = 0;  ///< |op(A)| |x|; |op(A)| summed

  __device__ void take(double v, double x) {
    residual.subtract_product(v, x);
    scale += fabs(v * x);
    norm += fabs(v);
  }
  __device__ void sum_lanes() {
    residual.sum_lanes();
    scale = cuda::sum_lanes(scale);
    norm = cuda::sum_lanes(norm);
  }
  /// Notes what the row says. @returns its residual
  __device__ double finish(double b, double x, ResidualSizes& sizes) {
    residual.add(b, 0);
    const double r = residual.high + residual.low;
    sizes.add(r, scale + fabs(b), x, b, norm);
    return r;
  }
};

/// What the host reads after a pass: pinned memory that the GPU writes.
struct ResidualEnd {
  double found[kResidualColumns][ResidualSizes::kCount];
  double substitution;  ///< seconds from the gathering of right-hand sides before it to the residual
  int aborted;          ///< nonzero: the substitution before it was given up
};

struct ResidualJob {
  const double* b[kResidualColumns];
  const double* x[kResidualColumns];
  double* r[kResidualColumns];  ///< may be null
  int columns;
  bool transpose;
  const double* packed;         ///< n x kResidualColumns, row-major: x; where there are several columns
  unsigned long long* largest;  ///< kResidualColumns x ResidualSizes, as bits; zero, before and after
  int* ticket;                  ///< likewise
  unsigned long long* clock;    ///< [0] when right-hand sides were gathered; [1] is written
  const int* aborted;           ///< null: nothing to report
  ResidualEnd* end;
};

/// Calls use(value, column) for every entry of a row of op(A), one after another, in all eight threads of the group.
template <class Use>
__device__ inline void visit_row_together(const DevicePattern& p, Index row, bool transpose, int lane, Use&& use) {
  const unsigned group = 0xffu << (threadIdx.x % 32 / kLanes * kLanes);
  const auto visit = [&](Offset begin, Offset end, auto&& fetch) {
    for (Offset q = begin; q < end; q += kLanes) {
      double mine = 0;
      Index at = row;
      if (q + lane < end) fetch(q + lane, mine, at);
#pragma unroll
      for (int j = 0; j < kLanes; ++j) use(__shfl_sync(group, mine, j, kLanes), __shfl_sync(group, at, j, kLanes));
    }
  };
  if (!p.general || transpose)
    visit(p.col_ptr[row], p.col_ptr[row + 1], [&](Offset q, double& v, Index& c) {
      v = p.values[q];
      c = p.row_ind[q];
    });
  if (p.row_ptr == nullptr || (p.general && transpose)) return;
  visit(p.row_ptr[row], p.row_ptr[row + 1], [&](Offset q, double& v, Index& c) {
    v = p.values[p.row_source[q]];
    c = p.row_col[q];
  });
}

/// Maxima over all blocks, by column, to the host's memory; a row of blocks may have columns of its own. The bits of
/// numbers that are not negative are ordered as the numbers are. Blocks look before they raise a maximum: atomic
/// operations on one place come one after the other.
template <int Columns>
__device__ inline void report_sizes(ResidualSizes& mine, const ResidualJob& job) {
  constexpr int kNumbers = Columns * ResidualSizes::kCount, kWarps = kSystemThreads / 32;
  __shared__ double warps[kWarps][kNumbers];
  const int lane = static_cast<int>(threadIdx.x) % 32, warp = static_cast<int>(threadIdx.x) / 32;
#pragma unroll
  for (int k = 0; k < ResidualSizes::kCount; ++k) {
    double x = mine.of[k];
#pragma unroll
    for (int d = Columns; d < 32; d *= 2) x = larger(x, __shfl_xor_sync(0xffffffffu, x, d));
    if (lane < Columns) warps[warp][lane * ResidualSizes::kCount + k] = x;
  }
  __syncthreads();
  if (threadIdx.x < kNumbers) {
    double x = 0;
    for (int w = 0; w < kWarps; ++w) x = larger(x, warps[w][threadIdx.x]);
    unsigned long long* const place = job.largest + blockIdx.y * kNumbers + threadIdx.x;
    const auto bits = static_cast<unsigned long long>(__double_as_longlong(x));
    if (bits > *static_cast<volatile unsigned long long*>(place)) atomicMax(place, bits);
  }
  if (!last_block(job.ticket)) return;
  if (threadIdx.x < kNumbers * gridDim.y)
    job.end->found[threadIdx.x / ResidualSizes::kCount][threadIdx.x % ResidualSizes::kCount] =
        __longlong_as_double(static_cast<long long>(atomicExch(job.largest + threadIdx.x, 0ULL)));
  if (threadIdx.x != 0) return;
  job.end->substitution = 1e-9 * static_cast<double>(job.clock[1] - job.clock[0]);
  job.end->aborted = job.aborted != nullptr ? *job.aborted : 0;
}

/// Calls use0 or use1(value, x of its column) for this lane's share of a row of op(A): use0 for what stands in the
/// columns, use1 for what the index by rows knows. Both are fetched side by side, Batch of each at a time, or a row
/// would be a chain of waits for the memory.
template <int Batch, class Value, class Use0, class Use1>
__device__ inline void visit_row_ahead(const DevicePattern& p, Index row, bool transpose, int lane, const Value* x,
                                       Use0&& use0, Use1&& use1) {
  const auto* const values = reinterpret_cast<const Value*>(p.values);
  Offset at[2] = {}, end[2] = {};  // places in the columns, and in the index by rows
  if (!p.general || transpose) {
    at[0] = p.col_ptr[row] + lane;
    end[0] = p.col_ptr[row + 1];
  }
  if (p.row_ptr != nullptr && !(p.general && transpose)) {
    at[1] = p.row_ptr[row] + lane;
    end[1] = p.row_ptr[row + 1];
  }
  for (; at[0] < end[0] || at[1] < end[1]; at[0] += Batch * kLanes, at[1] += Batch * kLanes) {
    Value value[2][Batch], other[2][Batch];
    Index col[2][Batch];
    std::uint32_t source[Batch];
#pragma unroll
    for (int k = 0; k < Batch; ++k) {
      const Offset a = at[0] + k * kLanes, b = at[1] + k * kLanes;
      value[0][k] = a < end[0] ? values[a] : Value{};
      col[0][k] = a < end[0] ? p.row_ind[a] : row;
      source[k] = b < end[1] ? p.row_source[b] : 0;
      col[1][k] = b < end[1] ? p.row_col[b] : row;
    }
#pragma unroll
    for (int k = 0; k < Batch; ++k) {
      other[0][k] = x[col[0][k]];
      other[1][k] = x[col[1][k]];
      value[1][k] = values[source[k]];
    }
#pragma unroll
    for (int k = 0; k < Batch; ++k)
      if (at[0] + k * kLanes < end[0]) use0(value[0][k], other[0][k]);
#pragma unroll
    for (int k = 0; k < Batch; ++k)
      if (at[1] + k * kLanes < end[1]) use1(value[1][k], other[1][k]);
  }
}

/// Columns: 1 or kResidualColumns (of which job.columns are wanted). Batch: of visit_row_ahead(). More blocks on a
/// multiprocessor by fewer registers (64 instead of 78) make it slower (0.67 instead of 0.62 ms, chain of 400 bodies).
template <int Columns, int Batch>
__global__ void __launch_bounds__(kSystemThreads)
    residual_kernel(const DevicePattern p, const __grid_constant__ ResidualJob job) {
  static_assert(Columns == 1 || Columns == kLanes, "a thread of a group has a column");
  if (blockIdx.x == 0 && threadIdx.x == 0) job.clock[1] = nanoseconds_now();
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const int column = Columns == 1 ? 0 : lane;
  const Offset step = static_cast<Offset>(gridDim.x) * kRowsOfBlock;
  const Offset mine = threadIdx.x / kLanes;
  ResidualSizes sizes;
  for (Offset first = static_cast<Offset>(blockIdx.x) * kRowsOfBlock; first < p.n; first += step) {
    const bool inside = first + mine < p.n;
    const Index row = inside ? static_cast<Index>(first + mine) : 0;
    RowSums sums;
    const auto take = [&](double v, double x) { sums.take(v, x); };
    if constexpr (Columns == 1) {
      if (inside) visit_row_ahead<Batch>(p, row, job.transpose, lane, job.x[0], take, take);
      sums.sum_lanes();
    } else if (inside) {
      visit_row_together(p, row, job.transpose, lane,
                         [&](double v, Index c) { take(v, job.packed[static_cast<Offset>(c) * Columns + lane]); });
    }
    if (!inside || column >= job.columns) continue;
    const double residual = sums.finish(job.b[column][row], job.x[column][row], sizes);
    double* r = job.r[column];
    if (r != nullptr && (Columns > 1 || lane == 0)) r[row] = residual;
  }
  report_sizes<Columns>(sizes, job);
}

/// y = op(A) x in plain double precision.
__global__ void __launch_bounds__(kSystemThreads)
    multiply_kernel(const DevicePattern p, const double* x, double* y, bool transpose) {
  const int lane = static_cast<int>(threadIdx.x) % kLanes;
  const Offset step = static_cast<Offset>(gridDim.x) * kRowsOfBlock;
  const Offset mine = threadIdx.x / kLanes;
  for (Offset first = static_cast<Offset>(blockIdx.x) * kRowsOfBlock; first < p.n; first += step) {
    const bool inside = first + mine < p.n;
    const Index row = inside ? static_cast<Index>(first + mine) : 0;
    double sum = 0;
    const auto take = [&](double v, double other) { sum += v * other; };
    if (inside) visit_row_ahead<2>(p, row, transpose, lane, x, take, take);
    sum = sum_lanes(sum);
    if (inside && lane == 0) y[row] = sum;
  }
}

/// packed (n x kResidualColumns, row-major) = job.x; zero where there is no column.
__global__ void pack_kernel(Index n, const __grid_constant__ ResidualJob job, double* packed) {
  const Offset at = static_cast<Offset>(blockIdx.x) * kSystemThreads + threadIdx.x;
  if (at >= static_cast<Offset>(n) * kResidualColumns) return;
  const auto c = static_cast<int>(at % kResidualColumns);
  packed[at] = c < job.columns ? job.x[c][at / kResidualColumns] : 0;
}

}  // namespace espalier::device::cuda

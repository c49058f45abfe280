/// \file
/// Products of FP32 factors on tensor cores that know FP16 and TF32 only: each operand is the sum of two parts, and
/// three of the four products of parts are added up (Markidis et al. 2018; Ootomo and Yokota 2022). The fourth one, of
/// the low parts, lies below the rounding of FP32.
///
/// Tensor cores cut off what they add to their sums. So a sum is taken over 32 columns only; these partial sums are
/// added in FP32, which rounds to nearest. Without that, errors grow with the number of pivots.
#pragma once

#include <cuda_fp16.h>

#include "device/cuda/kernels/fragments.cuh"

namespace espalier::device::cuda {

/// What the parts are. Both hold 11 bits of significand.
enum class SplitFormat {
  half,  ///< FP16: twice the rate, for operands whose size is bounded: see HalfScales
  tf32,  ///< the range of FP32
};

/// Powers of two that take two operands to the range of FP16.
struct HalfScales {
  float a, b;
};

/// Takes numbers of up to 2^exponent to 16,384, a quarter of what FP16 holds. Of numbers 2^-16 times as large both
/// parts are still normal ones; what is smaller loses bits, but never more than 2^-39 of the largest.
__device__ inline float half_scale(int exponent) {
  constexpr int kMost = 46;  // products of two scales are floats
  return ldexpf(1.0f, 14 - min(max(exponent, -kMost), kMost));
}
/// x < 2^exponent_of(x)
__device__ inline int exponent_of(float x) {
  int exponent = 0;
  if (x > 0 && x < 1e37f) frexpf(x, &exponent);
  return exponent;
}

/// What is known of the entries of the factors. Those of a Cholesky factor are at most the root of the largest entry of
/// the matrix. A column of L with an entry above `growth` has failed, and does not stay. U and L D may grow: to 2^10
/// times the largest entry here, and beyond it infinities say that FP16 does not do.
template <Kind K>
__device__ inline HalfScales operand_scales(float largest, float growth, int part) {
  constexpr int kGrowth = 10;
  const int exponent = exponent_of(largest);
  if constexpr (K == Kind::llt) {
    const float scale = half_scale((exponent + 1) >> 1);
    return {scale, scale};
  }
  const float lower = half_scale(exponent_of(growth)), second = half_scale(exponent + kGrowth);
  const bool lower_first = K == Kind::lu && part == 0;
  return {lower_first ? lower : second, lower_first ? second : lower};
}
template <Kind K>
__device__ inline HalfScales operand_scales(double, double, int) {
  return {1, 1};
}

/// What one operand's 16 columns of 8 rows come to: two elements in a register of each part (half), or one (tf32).
template <SplitFormat P>
struct SplitPanel;
template <>
struct SplitPanel<SplitFormat::half> {
  static constexpr int kRegisters = 2;
  unsigned high[kRegisters], low[kRegisters];

  __device__ void take(int word, float2 x, float scale) {
    const float p = x.x * scale, q = x.y * scale;
    const __half2 parts = __floats2half2_rn(p, q);
    const float2 back = __half22float2(parts);
    const __half2 rest = __floats2half2_rn(p - back.x, q - back.y);
    high[word] = reinterpret_cast<const unsigned&>(parts);
    low[word] = reinterpret_cast<const unsigned&>(rest);
  }
};
template <>
struct SplitPanel<SplitFormat::tf32> {
  static constexpr int kRegisters = 4;
  unsigned high[kRegisters], low[kRegisters];

  __device__ void take(int word, float2 x, float) {
    take_one(2 * word, x.x);
    take_one(2 * word + 1, x.y);
  }

 private:
  // The high part is rounded, half away from zero; the tensor cores ignore the last 13 bits of the low one.
  __device__ void take_one(int at, float x) {
    high[at] = (__float_as_uint(x) + 0x1000u) & 0xffffe000u;
    low[at] = __float_as_uint(x - __uint_as_float(high[at]));
  }
};

/// Columns t, t + 4, t + 8, t + 12 of the row that this lane reads of a panel in shared memory; times `scale` (half).
template <SplitFormat P>
__device__ inline SplitPanel<P> split_panel(const float* panel, int lane, float scale) {
  SplitPanel<P> s;
  s.take(0, load_pair(panel + lane * 2), scale);
  s.take(1, load_pair(panel + 64 + lane * 2), scale);
  return s;
}

/// sum (16 x 8) += A B, registers r and r + 1 of one part each: of A the panels of rows 0 to 7 and 8 to 15.
template <SplitFormat P>
__device__ inline void multiply_parts(float (&sum)[4], const unsigned* top, const unsigned* bottom, const unsigned* b) {
  if constexpr (P == SplitFormat::half)
    asm("mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 {%0,%1,%2,%3},{%4,%5,%6,%7},{%8,%9},{%0,%1,%2,%3};"
        : "+f"(sum[0]), "+f"(sum[1]), "+f"(sum[2]), "+f"(sum[3])
        : "r"(top[0]), "r"(bottom[0]), "r"(top[1]), "r"(bottom[1]), "r"(b[0]), "r"(b[1]));
  else
    asm("mma.sync.aligned.m16n8k8.row.col.f32.tf32.tf32.f32 {%0,%1,%2,%3},{%4,%5,%6,%7},{%8,%9},{%0,%1,%2,%3};"
        : "+f"(sum[0]), "+f"(sum[1]), "+f"(sum[2]), "+f"(sum[3])
        : "r"(top[0]), "r"(bottom[0]), "r"(top[1]), "r"(bottom[1]), "r"(b[0]), "r"(b[1]));
}

/// sums += A B^T for one chunk of 16 columns, as multiply_chunk(); times both scales (half). Products that go to the
/// same accumulator stand apart, because the next one has to wait for the last.
template <SplitFormat P, class S>
__device__ inline void multiply_split_chunk(Accumulator<float, S>& sums, const float* a, const float* b,
                                            const Corner<S>& at, HalfScales scales) {
  SplitPanel<P> right[S::kN];
#pragma unroll
  for (int n = 0; n < S::kN; ++n) right[n] = split_panel<P>(b + (at.col / 8 + n) * 128, at.lane, scales.b);
#pragma unroll
  for (int m = 0; m < S::kM; ++m) {
    const float* panel = a + (at.row + S::kRowStep * m) / 8 * 128;
    const SplitPanel<P> top = split_panel<P>(panel, at.lane, scales.a);
    const SplitPanel<P> bottom = split_panel<P>(panel + 128, at.lane, scales.a);
#pragma unroll
    for (int r = 0; r < SplitPanel<P>::kRegisters; r += 2) {
#pragma unroll
      for (int n = 0; n < S::kN; ++n) multiply_parts<P>(sums[m][n], top.low + r, bottom.low + r, right[n].high + r);
#pragma unroll
      for (int n = 0; n < S::kN; ++n) multiply_parts<P>(sums[m][n], top.high + r, bottom.high + r, right[n].low + r);
#pragma unroll
      for (int n = 0; n < S::kN; ++n) multiply_parts<P>(sums[m][n], top.high + r, bottom.high + r, right[n].high + r);
    }
  }
}

/// acc += sums, back from their scales.
template <SplitFormat P, int N>
__device__ inline void take_sums(float (&acc)[N][4], const float (&sums)[N][4], HalfScales scales) {
  const float back = P == SplitFormat::half ? 1 / (scales.a * scales.b) : 1.0f;
#pragma unroll
  for (int n = 0; n < N; ++n)
#pragma unroll
    for (int e = 0; e < 4; ++e) acc[n][e] = fmaf(sums[n][e], back, acc[n][e]);
}

inline constexpr int kChunksPerSum = 2;  ///< of a partial sum

/// Adds products of chunks to an accumulator: add() for each, finish() at the end.
template <class T, SplitFormat P, class S>
class Products;
template <SplitFormat P, class S>
class Products<double, P, S> {
 public:
  __device__ explicit Products(Accumulator<double, S>& acc, HalfScales) : acc_(acc) {}
  __device__ void add(const double* a, const double* b, const Corner<S>& at) { multiply_chunk<S>(acc_, a, b, at); }
  __device__ void finish() {}

 private:
  Accumulator<double, S>& acc_;
};
template <SplitFormat P, class S>
class Products<float, P, S> {
 public:
  __device__ explicit Products(Accumulator<float, S>& acc, HalfScales scales) : acc_(acc), scales_(scales) {}
  __device__ void add(const float* a, const float* b, const Corner<S>& at) {
    multiply_split_chunk<P, S>(sums_, a, b, at, scales_);
    if (++chunks_ == kChunksPerSum) finish();
  }
  __device__ void finish() {
    chunks_ = 0;
#pragma unroll
    for (int m = 0; m < S::kM; ++m) take_sums<P>(acc_[m], sums_[m], scales_);
#pragma unroll
    for (int m = 0; m < S::kM; ++m)
#pragma unroll
      for (int n = 0; n < S::kN; ++n)
#pragma unroll
        for (int e = 0; e < 4; ++e) sums_[m][n][e] = 0;
  }

 private:
  Accumulator<float, S>& acc_;
  HalfScales scales_;
  float sums_[S::kM][S::kN][4] = {};
  int chunks_ = 0;
};

}  // namespace espalier::device::cuda

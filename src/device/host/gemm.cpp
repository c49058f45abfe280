/// \file
/// General matrix product on column-major arrays, and the measured rate of the packed product.
#include <algorithm>
#include <chrono>
#include <vector>

#include "device/host/kernels.hpp"
#include "device/host/scratch.hpp"

namespace espalier::device::host {

namespace {

/// Panels (rows x depth) of op(X), where element (i, l) stands at x[i * row + l * column], times `scale`.
template <class T>
void pack_general(std::int64_t rows, std::int64_t depth, const T* x, std::int64_t row, std::int64_t column, T scale,
                  T* panels) {
  constexpr std::int64_t p = kPanel<T>;
  for (std::int64_t i = 0; i < padded<T>(rows); ++i) {
    for (std::int64_t l = 0; l < depth; ++l)
      panels[i / p * p * depth + l * p + i % p] = i < rows ? scale * x[i * row + l * column] : T(0);
  }
}

}  // namespace

template <class T>
void gemm(bool transpose_a, bool transpose_b, std::int64_t m, std::int64_t n, std::int64_t k, T alpha, const T* a,
          std::int64_t lda, const T* b, std::int64_t ldb, T beta, T* c, std::int64_t ldc) {
  constexpr std::int64_t block = 192;
  T* memory = scratch<T>(3 * block * block);
  T *left = memory, *right = memory + block * block, *tile = right + block * block;
  const std::int64_t a_row = transpose_a ? lda : 1, a_column = transpose_a ? 1 : lda;
  const std::int64_t b_row = transpose_b ? 1 : ldb, b_column = transpose_b ? ldb : 1;  // rows of op(B)^T
  for (std::int64_t j = 0; j < n; j += block) {
    const std::int64_t columns = std::min(block, n - j);
    for (std::int64_t i = 0; i < m; i += block) {
      const std::int64_t rows = std::min(block, m - i);
      std::fill(tile, tile + block * padded<T>(columns), T(0));
      for (std::int64_t l = 0; l < k; l += block) {
        const std::int64_t depth = std::min(block, k - l);
        pack_general(rows, depth, a + i * a_row + l * a_column, a_row, a_column, -alpha, left);
        pack_general(columns, depth, b + j * b_row + l * b_column, b_row, b_column, T(1), right);
        kernels<T>().gemm_nt(rows, columns, depth, left, right, tile, block);
      }
      for (std::int64_t s = 0; s < columns; ++s) {
        T* out = c + (j + s) * ldc + i;
        for (std::int64_t r = 0; r < rows; ++r) out[r] = (beta == T(0) ? T(0) : beta * out[r]) + tile[s * block + r];
      }
    }
  }
}

template void gemm(bool, bool, std::int64_t, std::int64_t, std::int64_t, double, const double*, std::int64_t,
                   const double*, std::int64_t, double, double*, std::int64_t);
template void gemm(bool, bool, std::int64_t, std::int64_t, std::int64_t, float, const float*, std::int64_t,
                   const float*, std::int64_t, float, float*, std::int64_t);

double measure_gemm_rate(double seconds) {
  constexpr std::int64_t size = 128;  // three operands of 128 KiB
  using Clock = std::chrono::steady_clock;
  std::vector<double> memory(3 * size * size + 8, 0.0);
  double* a = memory.data() + (8 - reinterpret_cast<std::uintptr_t>(memory.data()) / sizeof(double) % 8) % 8;
  const auto start = Clock::now();
  std::int64_t calls = 0;
  double elapsed = 0;
  do {
    for (int i = 0; i < 16; ++i, ++calls)
      kernels<double>().gemm_nt(size, size, size, a, a + size * size, a + 2 * size * size, size);
    elapsed = std::chrono::duration<double>(Clock::now() - start).count();
  } while (elapsed < seconds);
  return static_cast<double>(2 * size * size * size * calls) / elapsed;
}

}  // namespace espalier::device::host

/// \file
/// A general matrix product by the packed kernels of the host, to be measured beside a BLAS.
#pragma once

#include <cstdint>

namespace espalier::device::host {

/// C (m x n) = alpha op(A) op(B) + beta C on column-major arrays like BLAS gemm, on one thread. T = double or float.
template <class T>
void gemm(bool transpose_a, bool transpose_b, std::int64_t m, std::int64_t n, std::int64_t k, T alpha, const T* a,
          std::int64_t lda, const T* b, std::int64_t ldb, T beta, T* c, std::int64_t ldc);

}  // namespace espalier::device::host

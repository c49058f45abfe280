#include "device/cuda/out_of_core/panel_products.hpp"

namespace espalier::device::cuda {

namespace {

// One body for several instruction sets; the resolver does not live with the sanitizers.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define ESPALIER_CLONES __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define ESPALIER_CLONES
#endif
#define ESPALIER_INLINE __attribute__((always_inline)) inline

// v(8 rows) -= panel x for one panel in each of `chunks` chunks that are `stride` apart; x as order_chunk leaves it.
template <class T>
ESPALIER_INLINE void multiply_panel(const T* a, Offset stride, Index chunks, const T* x, Index columns, T* v) {
  for (Index c = 0; c < columns; ++c) {
    T sum[8][8] = {};
    for (Index q = 0; q < chunks; ++q) {
      const T* p = a + q * stride;
      const T* y = x + (q * columns + c) * 16;
      for (int h = 0; h < 2; ++h)
        for (int r = 0; r < 8; ++r)
          for (int k = 0; k < 8; ++k) sum[r][k] += p[h * 64 + r * 8 + k] * y[h * 8 + k];
    }
    for (int r = 0; r < 8; ++r) {
      T s = 0;
      for (int k = 0; k < 8; ++k) s += sum[r][k];
      v[r * columns + c] -= s;
    }
  }
}

// sum (16 columns, panel order) += panels^T v for `panels` panels one after another.
template <class T>
ESPALIER_INLINE void multiply_transposed(const T* a, Index panels, const T* v, Index columns, T* sum) {
  for (Index c = 0; c < columns; ++c) {
    T lo[8] = {}, hi[8] = {};
    for (Index p = 0; p < panels; ++p, a += 128)
      for (int r = 0; r < 8; ++r) {
        const T y = v[(p * 8 + r) * columns + c];
        for (int k = 0; k < 8; ++k) lo[k] += a[r * 8 + k] * y;
        for (int k = 0; k < 8; ++k) hi[k] += a[64 + r * 8 + k] * y;
      }
    a -= panels * 128;
    for (int k = 0; k < 8; ++k) {
      sum[c * 16 + k] += lo[k];
      sum[c * 16 + 8 + k] += hi[k];
    }
  }
}

}  // namespace

ESPALIER_CLONES void panels_forward(const double* a, Offset stride, Index chunks, Index panels, const double* x,
                                    Index columns, double* v) {
  for (Index p = 0; p < panels; ++p) multiply_panel(a + p * 128, stride, chunks, x, columns, v + p * 8 * columns);
}
ESPALIER_CLONES void panels_forward(const float* a, Offset stride, Index chunks, Index panels, const float* x,
                                    Index columns, float* v) {
  for (Index p = 0; p < panels; ++p) multiply_panel(a + p * 128, stride, chunks, x, columns, v + p * 8 * columns);
}
ESPALIER_CLONES void panels_backward(const double* a, Index panels, const double* v, Index columns, double* sum) {
  multiply_transposed(a, panels, v, columns, sum);
}
ESPALIER_CLONES void panels_backward(const float* a, Index panels, const float* v, Index columns, float* sum) {
  multiply_transposed(a, panels, v, columns, sum);
}

}  // namespace espalier::device::cuda

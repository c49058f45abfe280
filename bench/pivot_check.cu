// The factorizations of one pivot block (src/device/cuda/pivots.cuh, diagonal.cuh), alone on the GPU, for every size.
// Symmetric indefinite: M A M^T = D, and the signs of D's eigenvalues against those that the kernel counts, also for
// blocks whose diagonal is zero, so that only pairs can be pivots. Positive definite: M A M^T = I. Unsymmetric: M A is
// upper triangular, V^T its inverse, A V^T (the rows of L, in any order) at most 1, and the product of the pivots the
// determinant by elimination on the host. Prints the clock cycles of a pivot.
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "device/cuda/kernels/diagonal_lu.cuh"

namespace {

using namespace espalier::device::cuda;

template <class T>
__global__ void __launch_bounds__(kThreads)
    invert(const __grid_constant__ FactorState<T> s, const T* from, T* to, int size, int n, long long* cycles) {
  extern __shared__ __align__(128) unsigned char area[];
  T* a = reinterpret_cast<T*>(area);
  T* m = a + size * (size + 4);
  for (int r = threadIdx.x; r < size; r += kThreads)
    for (int c = 0; c < size; ++c) a[c * (size + 4) + r] = r < n && c <= r ? from[c * size + r] : T(0);
  __syncthreads();
  const long long start = clock64();
  invert_ldlt(a, size + 4, size, n, m, size + 4, PivotSink<T>{&s, 0, n});
  if (threadIdx.x == 0) *cycles = clock64() - start;
  for (int r = threadIdx.x; r < size; r += kThreads)
    for (int c = 0; c < size; ++c) to[c * size + r] = m[c * (size + 4) + r];
}

template <class T>
T* on_device(std::size_t count) {
  T* p = nullptr;
  if (cudaMalloc(&p, count * sizeof(T)) != cudaSuccess || cudaMemset(p, 0, count * sizeof(T)) != cudaSuccess)
    std::exit(2);
  return p;
}

/// A symmetric block; kind 0: diagonally dominant with mixed signs, 1: random, 2: random with a zero diagonal.
std::vector<double> block(int n, int size, int kind, std::mt19937& random) {
  std::uniform_real_distribution<double> any(-1, 1);
  std::vector<double> a(static_cast<std::size_t>(size) * size, 0);
  for (int c = 0; c < n; ++c)
    for (int r = c; r < n; ++r) {
      double v = any(random);
      if (r == c && kind == 0) v = (c % 3 == 0 ? -1 : 1) * (n + 1.0);
      if (r == c && kind == 2) v = 0;
      a[c * size + r] = a[r * size + c] = v;
    }
  return a;
}

struct Totals {
  int failures = 0, pairs = 0;
  double error = 0;
};

/// || M A M^T - D || / || D ||, and the number of negative eigenvalues of D.
template <class T>
double error_of(const std::vector<double>& a, const std::vector<T>& m, const std::vector<T>& d, const std::vector<T>& e,
                int n, int size, int& negative) {
  std::vector<double> ma(a.size(), 0), x(a.size(), 0);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k)
      for (int j = 0; j < n; ++j) ma[j * size + i] += static_cast<double>(m[k * size + i]) * a[j * size + k];
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k)
      for (int j = 0; j < n; ++j) x[j * size + i] += ma[k * size + i] * static_cast<double>(m[k * size + j]);
  negative = 0;
  double norm = 0, error = 0;
  for (int k = 0; k < n; ++k) {
    const double p = d[k], q = e[k];
    if (q == 0) {
      x[k * size + k] -= 1 / p;
      norm = std::max(norm, std::abs(1 / p));
      negative += p < 0 ? 1 : 0;
      continue;
    }
    const double r = d[k + 1], det = p * r - q * q;
    x[k * size + k] -= r / det;
    x[(k + 1) * size + k + 1] -= p / det;
    x[(k + 1) * size + k] += q / det;
    x[k * size + k + 1] += q / det;
    norm = std::max(norm, std::abs(q / det));
    negative += det < 0 ? 1 : (p < 0 ? 2 : 0);
    ++k;
  }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) error = std::max(error, std::abs(x[j * size + i]));
  return error / norm;
}

template <class T>
Totals check(const char* name) {
  Totals all;
  FactorState<T> s{};
  s.inverse_d = on_device<T>(64);
  s.inverse_e = on_device<T>(64);
  s.pivot = on_device<T>(64);
  s.replaced = on_device<unsigned char>(64);
  s.control = on_device<int>(kCounters);
  s.limits = on_device<T>(2);
  T* from = on_device<T>(64 * 64);
  T* to = on_device<T>(64 * 64);
  auto* cycles = on_device<long long>(1);
  std::mt19937 random(7);
  for (int n = 1; n <= 64; ++n)
    for (int kind = 0; kind < 3; ++kind) {
      if (n == 1 && kind == 2) continue;  // zero
      const int size = (n + 15) / 16 * 16;
      std::vector<double> a = block(n, size, kind, random);
      std::vector<T> given(a.begin(), a.end()), m(a.size()), d(64), e(64);
      for (std::size_t k = 0; k < a.size(); ++k) a[k] = given[k];
      int control[kCounters] = {};
      long long took = 0;
      cudaMemset(s.control, 0, sizeof control);
      cudaMemcpy(from, given.data(), given.size() * sizeof(T), cudaMemcpyHostToDevice);
      const std::size_t bytes = 2 * size * (size + 4) * sizeof(T);
      cudaFuncSetAttribute(invert<T>, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes));
      for (int turn = 0; turn < 2; ++turn) {
        cudaMemset(s.control, 0, sizeof control);
        invert<T><<<1, kThreads, bytes>>>(s, from, to, size, n, cycles);
      }
      if (cudaDeviceSynchronize() != cudaSuccess) std::exit(2);
      cudaMemcpy(m.data(), to, m.size() * sizeof(T), cudaMemcpyDeviceToHost);
      cudaMemcpy(d.data(), s.inverse_d, n * sizeof(T), cudaMemcpyDeviceToHost);
      cudaMemcpy(e.data(), s.inverse_e, n * sizeof(T), cudaMemcpyDeviceToHost);
      cudaMemcpy(control, s.control, sizeof control, cudaMemcpyDeviceToHost);
      cudaMemcpy(&took, cycles, sizeof took, cudaMemcpyDeviceToHost);
      int negative = 0;
      const double error = error_of(a, m, d, e, n, size, negative);
      // M has a norm of up to 2.6^(pairs); random blocks stay far below that.
      const double limit = 1e4 * n * (sizeof(T) == 8 ? 2.2e-16 : 1.2e-7);
      const bool good = error <= limit && negative == control[kNegative] && (kind != 2 || control[kTwoByTwo] > 0);
      all.failures += good ? 0 : 1;
      all.pairs += control[kTwoByTwo];
      all.error = std::max(all.error, error);
      if (!good || n % 16 == 0)
        std::printf("%s n %2d kind %d: error %.1e, negative %d / %d, pairs %d, %.0f cycles a pivot%s\n", name, n, kind,
                    error, control[kNegative], negative, control[kTwoByTwo], static_cast<double>(took) / n,
                    good ? "" : "   FAILED");
    }
  return all;
}

/// One tile by L L^T or L U: M to `to`, V (lu) to `upper`.
template <class T, bool kUnsymmetric>
__global__ void __launch_bounds__(kThreads) invert_triangular(const __grid_constant__ FactorState<T> s, const T* from,
                                                              T* to, T* upper, int size, int n, long long* cycles) {
  extern __shared__ __align__(128) unsigned char area[];
  T* a = reinterpret_cast<T*>(area);
  const int ld = size + 4;
  T* m = a + size * ld;
  const auto copy = [&](auto&& use) {
    __syncthreads();
    for (int x = threadIdx.x; x < size * size; x += kThreads) use(x % size, x / size);
    __syncthreads();
  };
  copy([&](int r, int c) { a[c * ld + r] = r < n && c < n ? from[c * size + r] : T(r == c ? 1 : 0); });
  const long long start = clock64();
  if constexpr (!kUnsymmetric) {
    invert_cholesky(a, ld, size, n, m, ld, PivotSink<T>{&s, 0, n});
  } else {
    invert_lower_lu(a, ld, size, n, m, ld, PivotSink<T>{&s, 0, n});
  }
  const long long lower = clock64();
  copy([&](int r, int c) { to[c * size + r] = m[c * ld + r]; });
  const long long middle = clock64();
  if constexpr (kUnsymmetric) invert_upper_lu(a, ld, size, m, ld);
  if (threadIdx.x == 0) {
    cycles[0] = lower - start;
    cycles[1] = clock64() - middle;
  }
  copy([&](int r, int c) { upper[c * size + r] = m[c * ld + r]; });
}

using Matrix = std::vector<double>;  // column-major, `size` rows

/// X Y, X Y^T or X^T Y of the leading n rows and columns.
Matrix product(const Matrix& x, bool tx, const Matrix& y, bool ty, int n, int size) {
  Matrix z(x.size(), 0);
  for (int j = 0; j < n; ++j)
    for (int k = 0; k < n; ++k)
      for (int i = 0; i < n; ++i)
        z[j * size + i] += (tx ? x[i * size + k] : x[k * size + i]) * (ty ? y[k * size + j] : y[j * size + k]);
  return z;
}

/// Largest deviation of the leading n rows and columns from the identity; only below the diagonal: from zero.
double deviation(const Matrix& x, int n, int size, bool below) {
  double d = 0;
  for (int j = 0; j < n; ++j)
    for (int i = below ? j + 1 : 0; i < n; ++i) d = std::max(d, std::abs(x[j * size + i] - (i == j ? 1 : 0)));
  return d;
}

double largest(const Matrix& x, int n, int size) {
  double d = 0;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) d = std::max(d, std::abs(x[j * size + i]));
  return d;
}

double determinant(Matrix a, int n, int size) {
  double det = 1;
  for (int k = 0; k < n; ++k) {
    int p = k;
    for (int i = k; i < n; ++i)
      if (std::abs(a[k * size + i]) > std::abs(a[k * size + p])) p = i;
    for (int j = 0; j < n; ++j) std::swap(a[j * size + k], a[j * size + p]);
    det *= (p == k ? 1 : -1) * a[k * size + k];
    for (int i = k + 1; i < n; ++i)
      for (int j = k + 1; j < n; ++j) a[j * size + i] -= a[k * size + i] / a[k * size + k] * a[j * size + k];
  }
  return det;
}

/// Diagonally dominant (and symmetric for L L^T), or for L U also any random block, which exchanges many rows.
Matrix triangular_block(int n, int size, bool unsymmetric, bool dominant, std::mt19937& random) {
  std::uniform_real_distribution<double> any(-1, 1);
  Matrix a(static_cast<std::size_t>(size) * size, 0);
  for (int c = 0; c < n; ++c)
    for (int r = unsymmetric ? 0 : c; r < n; ++r) {
      a[c * size + r] = static_cast<float>(r == c && dominant ? n + 1 : any(random));
      if (!unsymmetric) a[r * size + c] = a[c * size + r];
    }
  return a;
}

template <class T, bool kUnsymmetric>
int check_triangular(const char* name) {
  FactorState<T> s{};
  s.pivot = on_device<T>(64);
  s.replaced = on_device<unsigned char>(64);
  s.control = on_device<int>(kCounters);
  s.limits = on_device<T>(2);
  T *from = on_device<T>(64 * 64), *to = on_device<T>(64 * 64), *upper = on_device<T>(64 * 64);
  auto* cycles = on_device<long long>(2);
  std::mt19937 random(11);
  int failures = 0;
  const double unit = sizeof(T) == 8 ? 1.1e-16 : 6e-8;
  for (int n = 1; n <= 64; ++n)
    for (int kind = 0; kind < (kUnsymmetric ? 2 : 1); ++kind) {
      const int size = (n + 15) / 16 * 16;
      const Matrix a = triangular_block(n, size, kUnsymmetric, kind == 0, random);
      const std::vector<T> given(a.begin(), a.end());
      std::vector<T> m(a.size()), v(a.size()), pivot(64);
      cudaMemcpy(from, given.data(), given.size() * sizeof(T), cudaMemcpyHostToDevice);
      const std::size_t bytes = 2 * size * (size + 4) * sizeof(T);
      const auto kernel = invert_triangular<T, kUnsymmetric>;
      cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes));
      for (int turn = 0; turn < 2; ++turn) kernel<<<1, kThreads, bytes>>>(s, from, to, upper, size, n, cycles);
      if (cudaDeviceSynchronize() != cudaSuccess) std::exit(2);
      long long took[2] = {};
      cudaMemcpy(m.data(), to, m.size() * sizeof(T), cudaMemcpyDeviceToHost);
      cudaMemcpy(v.data(), upper, v.size() * sizeof(T), cudaMemcpyDeviceToHost);
      cudaMemcpy(pivot.data(), s.pivot, 64 * sizeof(T), cudaMemcpyDeviceToHost);
      cudaMemcpy(took, cycles, sizeof took, cudaMemcpyDeviceToHost);
      const Matrix inverse(m.begin(), m.end()), transposed(v.begin(), v.end());
      const Matrix u = product(inverse, false, a, false, n, size);
      double error = 0, det = 1, growth = 0;
      for (int k = 0; k < n; ++k) det *= pivot[k];
      if (kUnsymmetric) {
        const double scale = n * largest(inverse, n, size) * largest(a, n, size);
        error = std::max(deviation(u, n, size, true) / scale,
                         deviation(product(transposed, true, u, false, n, size), n, size, false) /
                             (scale * n * largest(transposed, n, size)));
        growth = largest(product(a, false, transposed, true, n, size), n, size) - 1;
        // Magnitudes are compared to within one part in 2^20.
        if (growth > 2e-6 + 1e3 * n * unit * scale * largest(transposed, n, size)) error = growth;
      } else {
        error = deviation(product(u, false, inverse, true, n, size), n, size, false);
      }
      const double truth = determinant(a, n, size);
      const double det_error = std::abs(det / truth - 1);
      const bool good = error <= 100 * n * unit && det_error <= 1e4 * n * unit;
      failures += good ? 0 : 1;
      if (!good || n % 16 == 0)
        std::printf("%s n %2d kind %d: error %.1e, |L| - 1 %.1e, determinant %.1e, %lld + %lld cycles%s\n", name, n,
                    kind, error, growth, det_error, took[0], took[1], good ? "" : "   FAILED");
    }
  return failures;
}

}  // namespace

int main() {
  int failures = 0;
  const Totals d = check<double>("fp64"), f = check<float>("fp32");
  failures = d.failures + f.failures;
  failures += check_triangular<double, false>("llt fp64") + check_triangular<float, false>("llt fp32");
  failures += check_triangular<double, true>("lu fp64") + check_triangular<float, true>("lu fp32");
  std::printf("pairs %d + %d, largest errors %.1e and %.1e, %d failures\n", d.pairs, f.pairs, d.error, f.error,
              failures);
  return failures == 0 ? 0 : 1;
}

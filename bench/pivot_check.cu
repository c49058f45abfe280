// The factorization of one pivot block with 1x1 and 2x2 pivots (src/device/cuda/pivots.cuh), alone on the GPU: random
// blocks of every size, among them some whose diagonal is zero, so that only pairs can be pivots. Truth: M A M^T = D
// and the signs of D's eigenvalues against those that the kernel counts. Prints the clock cycles of a pivot.
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "device/cuda/diagonal.cuh"

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

}  // namespace

int main() {
  int failures = 0;
  const Totals d = check<double>("fp64"), f = check<float>("fp32");
  failures = d.failures + f.failures;
  std::printf("pairs %d + %d, largest errors %.1e and %.1e, %d failures\n", d.pairs, f.pairs, d.error, f.error,
              failures);
  return failures == 0 ? 0 : 1;
}

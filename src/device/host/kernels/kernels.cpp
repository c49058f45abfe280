#include "device/host/kernels/kernels.hpp"

#include <algorithm>
#include <chrono>
#include <new>
#include <vector>

#include "device/host/kernels/instruction_sets.hpp"
#include "device/host/kernels/kernel_parts.hpp"
#include "device/host/scratch.hpp"
#include "hwy/highway.h"

namespace espalier::device::host {

namespace {

template <class T>
Kernels<T> make_table(bool hermitian) {
  check_instruction_sets();
  Kernels<T> table{};
  fill_products(table, hermitian);
  fill_layout(table, hermitian);
  fill_substitution(table, hermitian);
  fill_cholesky(table, hermitian);
  fill_ldlt(table, hermitian);
  fill_lu(table, hermitian);
  fill_inverse(table, hermitian);
  return table;
}

/// One thread's buffer.
class Scratch {
 public:
  Scratch() = default;
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  ~Scratch() { release(); }

  void* take(std::int64_t bytes) {
    if (bytes > size_) {
      release();
      data_ = ::operator new (static_cast<std::size_t>(bytes), std::align_val_t{64});
      size_ = bytes;
    }
    return data_;
  }

 private:
  void release() {
    ::operator delete (data_, std::align_val_t{64});
    data_ = nullptr;
    size_ = 0;
  }

  void* data_ = nullptr;
  std::int64_t size_ = 0;
};

}  // namespace

void* scratch_bytes(std::int64_t bytes) {
  thread_local Scratch scratch;
  return scratch.take(bytes);
}

template <class T>
const Kernels<T>& kernels(bool hermitian) {
  static const Kernels<T> table = make_table<T>(false);
  if (!base::ScalarTraits<T>::is_complex || !hermitian) return table;
  static const Kernels<T> table_hermitian = make_table<T>(true);
  return table_hermitian;
}

template <class T>
std::vector<Kernels<T>> all_kernels(bool hermitian) {
  std::vector<Kernels<T>> tables;
  std::int64_t left = hwy::SupportedTargets() & HWY_TARGETS;
  while (left != 0) {
    const std::int64_t target = left & -left;  // the lowest bit is the best target
    left ^= target;
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    tables.push_back(make_table<T>(hermitian));
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return tables;
}

#define ESPALIER_INSTANTIATE(T)             \
  template const Kernels<T>& kernels(bool); \
  template std::vector<Kernels<T>> all_kernels(bool);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

double measure_gemm_rate(double seconds) {
  constexpr std::int64_t size = 128;  // three operands of 128 KiB
  constexpr int calls = 16;           // about 0.7 ms at 95 Gflop/s
  using Clock = std::chrono::steady_clock;
  std::vector<double> memory(3 * size * size + 8, 0.0);
  double* a = memory.data() + (8 - reinterpret_cast<std::uintptr_t>(memory.data()) / sizeof(double) % 8) % 8;
  const auto start = Clock::now();
  double best = 0;  // of all batches: other processes only slow a batch down
  auto now = start;
  do {
    const auto begin = now;
    for (int i = 0; i < calls; ++i)
      kernels<double>().gemm_nt(size, size, size, a, a + size * size, a + 2 * size * size, size);
    now = Clock::now();
    const double rate = 2.0 * size * size * size * calls / std::chrono::duration<double>(now - begin).count();
    best = std::max(best, rate);
  } while (std::chrono::duration<double>(now - start).count() < seconds);
  return best;
}

}  // namespace espalier::device::host

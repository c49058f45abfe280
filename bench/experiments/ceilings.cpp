#include "experiments/ceilings.hpp"

#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>
#include <vector>

#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "base/timeline.hpp"
#include "device/host/kernels/kernels.hpp"

namespace espalier::bench {
namespace {

using base::now_seconds;

/// Samples per second of bytes, best last.
struct Bandwidth {
  std::vector<double> samples;
  void add(double bytes, double seconds) { samples.push_back(bytes / seconds); }
  [[nodiscard]] nlohmann::json record() const {
    std::vector<double> sorted = samples;
    std::sort(sorted.begin(), sorted.end());
    return {{"best", sorted.back()}, {"median", sorted[sorted.size() / 2]}, {"samples", samples}};
  }
};

/// Sum with enough independent partial sums that memory, not the adder, is the limit.
double sum_of(const double* x, std::int64_t count) {
  constexpr std::int64_t kSums = 64;
  double sums[kSums] = {};
  std::int64_t i = 0;
  for (; i + kSums <= count; i += kSums)
    for (std::int64_t k = 0; k < kSums; ++k) sums[k] += x[i + k];
  return std::accumulate(sums, sums + kSums, 0.0) + std::accumulate(x + i, x + count, 0.0);
}

/// Three arrays of which each worker owns a part that it has touched first.
class Streams {
 public:
  explicit Streams(int threads) : pool_(threads), parts_(static_cast<std::size_t>(threads)) {
    // Four times the last cache in all, so that no array is found there; an eighth of the memory at most.
    const long cache = std::max(sysconf(_SC_LEVEL3_CACHE_SIZE), 32L << 20);
    const long memory = sysconf(_SC_PHYS_PAGES) / 8 * sysconf(_SC_PAGESIZE);
    count_ = std::min(std::max(4 * cache, 192L << 20), memory) / (24L * threads);
    pool_.run([&](int worker) {
      for (auto& array : parts_[static_cast<std::size_t>(worker)].arrays) {
        array = base::Buffer<double>(count_, nullptr);
        std::fill(array.begin(), array.end(), 1.0);
      }
    });
  }

  double read() {
    const double start = now_seconds();
    pool_.run([&](int worker) {
      Share& part = parts_[static_cast<std::size_t>(worker)];
      part.sum = 0;
      for (const auto& array : part.arrays) part.sum += sum_of(array.data(), count_);
    });
    return now_seconds() - start;
  }

  double triad() {
    const double start = now_seconds();
    pool_.run([&](int worker) {
      Share& part = parts_[static_cast<std::size_t>(worker)];
      double* a = part.arrays[0].data();
      const double* b = part.arrays[1].data();
      const double* c = part.arrays[2].data();
      for (std::int64_t i = 0; i < count_; ++i) a[i] = b[i] + 0.5 * c[i];
    });
    return now_seconds() - start;
  }

  /// Bytes of one pass over the three arrays.
  [[nodiscard]] double bytes() const { return 24.0 * static_cast<double>(count_) * pool_.size(); }
  /// What the sums add up to: keeps them from being optimised away.
  [[nodiscard]] bool touched() const { return parts_.front().sum != 0; }

 private:
  struct Share {
    base::Buffer<double> arrays[3];
    double sum = 0;
  };
  base::ThreadPool pool_;
  std::vector<Share> parts_;
  std::int64_t count_ = 0;
};

nlohmann::json memory_record(const CeilingSettings& settings) {
  Streams streams(settings.threads);
  Bandwidth read, triad;
  const double end = now_seconds() + settings.seconds;
  do {
    read.add(streams.bytes(), streams.read());
    triad.add(streams.bytes(), streams.triad());
  } while (now_seconds() < end || read.samples.size() < 3);
  return {{"read_bytes_per_second", read.record()},
          {"triad_bytes_per_second", triad.record()},
          {"array_bytes", streams.bytes()},
          {"checked", streams.touched()}};
}

double gemm_rate_of_all(int threads, double seconds) {
  base::ThreadPool pool(threads);
  std::vector<double> rates(static_cast<std::size_t>(threads));
  pool.run([&](int worker) { rates[static_cast<std::size_t>(worker)] = device::host::measure_gemm_rate(seconds); });
  return std::accumulate(rates.begin(), rates.end(), 0.0);
}

}  // namespace

nlohmann::json measure_ceilings(const CeilingSettings& settings) {
  return {{"threads", settings.threads},
          {"kernels", device::host::kernels<double>().target},
          {"gemm_flops_per_second_one_thread", device::host::measure_gemm_rate(settings.seconds)},
          {"gemm_flops_per_second", gemm_rate_of_all(settings.threads, settings.seconds)},
          {"memory", memory_record(settings)},
          {"gpus", measure_gpu_ceilings(settings.seconds)}};
}

}  // namespace espalier::bench

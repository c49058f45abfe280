#include "device/cuda/executor/plan_values.hpp"

#include <algorithm>
#include <atomic>

namespace espalier::device::cuda {

Offset values_of(const plan::Plan& plan, base::ThreadPool* pool) {
  std::atomic<Offset> values{0};
  const auto scan = [&](std::int64_t begin, std::int64_t end) {
    Offset most = 0;
    for (auto k = begin; k < end; ++k) most = std::max(most, plan.entries[static_cast<std::size_t>(k)].source() + 1);
    Offset known = values.load();
    while (most > known && !values.compare_exchange_weak(known, most)) {
    }
  };
  constexpr std::int64_t kEntries = 1 << 18;  // per range of work
  const auto count = static_cast<std::int64_t>(plan.entries.size());
  if (pool != nullptr)
    pool->for_each_range(count, kEntries, scan);
  else
    scan(0, count);
  return values;
}

}  // namespace espalier::device::cuda

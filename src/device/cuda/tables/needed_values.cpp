#include "device/cuda/tables/needed_values.hpp"

#include <atomic>

namespace espalier::device::cuda {

std::vector<std::vector<std::uint32_t>> needed_values(const plan::Plan& plan, const DevicePlan& tables, Offset values,
                                                      base::ThreadPool* pool) {
  base::ThreadPool alone(1);
  base::ThreadPool& threads = pool != nullptr ? *pool : alone;
  const Offset chunks = (values + kValueChunk - 1) / kValueChunk;
  const std::size_t devices = tables.lists.size();
  std::vector<std::uint16_t> users(at(chunks), 0);  // bit d: device d
  constexpr std::int64_t kFronts = 64;              // per range of work
  threads.for_each_range(plan.fronts(), kFronts, [&](std::int64_t begin, std::int64_t end) {
    for (auto f = static_cast<Index>(begin); f < end; ++f) {
      const Front& x = tables.fronts[f];
      const bool movable = x.region >= tables.first_stealable;
      const auto mask = static_cast<std::uint16_t>(movable ? (1U << devices) - 1 : x.members);
      const Offset last = plan.entry_ptr[plan.first_tile[f + 1]];
      for (Offset e = plan.entry_ptr[plan.first_tile[f]]; e < last; ++e) {
        auto& chunk = users[static_cast<std::size_t>(plan.entries[at(e)].source() / kValueChunk)];
        std::atomic_ref<std::uint16_t> its_users(chunk);
        if ((its_users.load(std::memory_order_relaxed) & mask) != mask)
          its_users.fetch_or(mask, std::memory_order_relaxed);
      }
    }
  });
  std::vector<std::vector<std::uint32_t>> needed(devices);
  threads.for_each_range(static_cast<std::int64_t>(devices), 1, [&](std::int64_t begin, std::int64_t end) {
    for (auto d = static_cast<std::size_t>(std::max<std::int64_t>(begin, 1)); d < at(end); ++d)
      for (Offset c = 0; c < chunks; ++c)
        if ((users[at(c)] >> d & 1) != 0) needed[d].push_back(static_cast<std::uint32_t>(c));
  });
  return needed;
}

}  // namespace espalier::device::cuda

#include "out_of_core/disk_fronts.hpp"

#include <algorithm>
#include <utility>

namespace espalier::out_of_core {

void DiskFronts::begin_way(std::span<const Index> fronts, bool second) {
  const std::vector<Offset>& at = second ? plan_.factor2_store : plan_.factor_store;
  const Offset element = layout_.element_bytes();
  std::vector<StoreRange> parts;
  parts.reserve(fronts.size());
  for (const Index f : fronts) {
    if (!in_store(f)) continue;
    part_of_[static_cast<std::size_t>(f)] = static_cast<Index>(parts.size());
    parts.push_back({at[static_cast<std::size_t>(f)] * element, layout_.sizes().factor[f] * element});
  }
  store_.begin_parts(std::move(parts));
}

// The largest front, with blocks that begin before it and end behind it, and two for those who read and write.
Offset DiskFronts::least_window(const OutOfCorePlan& plan, const OutOfCoreLayout& layout, Offset block_bytes) {
  Offset largest = 0;
  for (std::size_t f = 0; f < plan.factor_store.size(); ++f)
    if (plan.factor_store[f] >= 0)
      largest = std::max(largest, layout.sizes().factor[static_cast<Index>(f)] * layout.element_bytes());
  return largest + 4 * block_bytes;
}

}  // namespace espalier::out_of_core

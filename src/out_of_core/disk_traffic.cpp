// The traffic of a store on disk, by its plan alone.
#include <algorithm>
#include <iterator>
#include <limits>
#include <set>
#include <utility>

#include "out_of_core/disk_store.hpp"

namespace espalier::out_of_core {

namespace {

// Uses of one block, by their number among those of all.
struct BlockUses {
  std::vector<std::size_t> at;
  std::size_t next = 0;
  std::size_t last_read = 0;  // one past it
  bool dirty = false, on_disk = false, in_memory = false;
};

}  // namespace

DiskTraffic traffic_of(const std::vector<StoreUse>& uses, Offset store_bytes, Offset lasts, Offset window_bytes) {
  const Offset block = DiskStore::block_for(window_bytes);
  const auto frames = static_cast<std::size_t>(std::max<Offset>(1, window_bytes / block));
  std::vector<BlockUses> blocks(static_cast<std::size_t>(store_bytes / block + 1));
  const auto each_block = [&](const StoreUse& u, auto&& use) {
    for (Offset b = u.range.at / block; b * block < u.range.at + u.range.bytes; ++b) use(static_cast<std::size_t>(b));
  };
  for (std::size_t k = 0; k < uses.size(); ++k)
    each_block(uses[k], [&](std::size_t b) {
      blocks[b].at.push_back(k);
      if (!uses[k].write) blocks[b].last_read = k + 1;
    });
  const auto next_use = [&](std::size_t b) {
    const BlockUses& x = blocks[b];
    if (x.next < x.at.size()) return x.at[x.next];
    return static_cast<Offset>(b) * block < lasts ? uses.size() + b : std::numeric_limits<std::size_t>::max();
  };
  DiskTraffic sum;
  std::set<std::pair<std::size_t, std::size_t>> in_memory;  // next use, block
  const auto let_go = [&](std::size_t k) {
    const std::size_t b = std::prev(in_memory.end())->second;
    in_memory.erase(std::prev(in_memory.end()));
    BlockUses& x = blocks[b];
    if (x.dirty && (static_cast<Offset>(b) * block < lasts || x.last_read > k)) {
      sum.written_bytes += block;
      x.on_disk = true;
    }
    x.dirty = x.in_memory = false;
  };
  for (std::size_t k = 0; k < uses.size(); ++k)
    each_block(uses[k], [&](std::size_t b) {
      BlockUses& x = blocks[b];
      if (x.in_memory) {
        in_memory.erase({next_use(b), b});
      } else {
        if (in_memory.size() >= frames) let_go(k);
        const Offset at = static_cast<Offset>(b) * block;
        const StoreRange& r = uses[k].range;
        const bool whole = uses[k].write && r.at <= at && at + block <= r.at + r.bytes;
        if (x.on_disk && !whole) sum.read_bytes += block;
        x.in_memory = true;
      }
      x.dirty = x.dirty || uses[k].write;
      ++x.next;
      in_memory.insert({next_use(b), b});
    });
  return sum;
}

}  // namespace espalier::out_of_core

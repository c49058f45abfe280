#include "out_of_core/copies.hpp"

#include <algorithm>
#include <cstring>

#include "base/copy_past_cache.hpp"
#include "base/scalar.hpp"

namespace espalier::out_of_core {

namespace {

constexpr std::int64_t kBytesPerRange = 512 << 10;  // of one thread: some 50 microseconds
constexpr std::int64_t kValuesPerRange = 16 << 10;

// use(part, offset in the part, offset in the range, size) for the parts of [begin, begin + size).
template <class Use>
void walk(const std::vector<Offset>& end, Offset begin, Offset size, Use&& use) {
  auto part = static_cast<std::size_t>(std::upper_bound(end.begin(), end.end(), begin) - end.begin());
  for (Offset done = 0; done < size; ++part) {
    const Offset start = part == 0 ? 0 : end[part - 1];
    const Offset now = std::min(end[part], begin + size) - (begin + done);
    use(part, begin + done - start, done, now);
    done += now;
  }
}

}  // namespace

void HostExtents::clear() {
  at_.clear();
  end_.clear();
}

void HostExtents::add(std::byte* at, Offset bytes) {
  if (bytes == 0) return;
  end_.push_back(this->bytes() + bytes);
  at_.push_back(at);
}

template <class Use>
void HostExtents::visit(Offset begin, Offset size, base::ThreadPool& pool, Use&& use) const {
  pool.for_each_range(size, kBytesPerRange, [&](std::int64_t b, std::int64_t e) {
    walk(end_, begin + b, e - b, [&](std::size_t part, Offset in_part, Offset done, Offset now) {
      use(at_[part] + in_part, b + done, static_cast<std::size_t>(now));
    });
  });
}

void HostExtents::copy_to(std::byte* to, Offset begin, Offset size, base::ThreadPool& pool, DiskStore* disk) const {
  visit(begin, size, pool, [&](const std::byte* at, Offset done, std::size_t n) {
    if (disk == nullptr) {
      std::memcpy(to + done, at, n);
      return;
    }
    disk->each_piece(at - disk->data(), static_cast<Offset>(n), DiskStore::Access::read,
                     [&](const std::byte* piece, Offset before, Offset bytes) {
                       std::memcpy(to + done + before, piece, static_cast<std::size_t>(bytes));
                     });
  });
}

void HostExtents::copy_from(const std::byte* from, Offset begin, Offset size, base::ThreadPool& pool,
                            DiskStore* disk) const {
  visit(begin, size, pool, [&](std::byte* at, Offset done, std::size_t n) {
    if (disk == nullptr) return base::copy_past_cache(at, from + done, n);
    disk->each_piece(at - disk->data(), static_cast<Offset>(n), DiskStore::Access::write,
                     [&](std::byte* piece, Offset before, Offset bytes) {
                       base::copy_past_cache(piece, from + done + before, static_cast<std::size_t>(bytes));
                     });
  });
}

void EntryRanges::set(const OutOfCoreLayout& layout, const OutOfCorePlan& units, const Operation& op) {
  plan_ = &layout.plan();
  first_.clear();
  end_.clear();
  const auto add = [&](Offset first, Offset count) {
    if (count == 0) return;
    end_.push_back(size() + count);
    first_.push_back(first);
  };
  if (op.grouped) {
    const ColumnGroup& g = units.groups[static_cast<std::size_t>(op.unit)];
    add(g.first_entry, g.entries);
    return;
  }
  for (const Index f : units.steps[static_cast<std::size_t>(op.unit)].fronts) {
    const Offset first = plan_->entry_ptr[plan_->first_tile[f]];
    add(first, plan_->entry_ptr[plan_->first_tile[f + 1]] - first);
  }
}

template <class T>
void EntryRanges::gather(std::span<const T> values, T* to, Offset begin, Offset size, base::ThreadPool& pool) const {
  pool.for_each_range(size, kValuesPerRange, [&](std::int64_t b, std::int64_t e) {
    walk(end_, begin + b, e - b, [&](std::size_t part, Offset in_part, Offset done, Offset now) {
      const plan::EntryPlace* from = plan_->entries.data() + first_[part] + in_part;
      for (Offset k = 0; k < now; ++k) to[b + done + k] = values[static_cast<std::size_t>(from[k].source())];
    });
  });
}

#define ESPALIER_INSTANTIATE(T) \
  template void EntryRanges::gather(std::span<const T>, T*, Offset, Offset, base::ThreadPool&) const;
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::out_of_core

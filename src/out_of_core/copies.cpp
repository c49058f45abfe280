#include "out_of_core/copies.hpp"

#include <algorithm>
#include <cstring>

#include "base/copy_past_cache.hpp"

namespace espalier::out_of_core {

namespace {

constexpr std::int64_t kBytesPerPiece = 512 << 10;  // of one thread: some 50 microseconds
constexpr std::int64_t kValuesPerPiece = 16 << 10;

// use(piece, offset in the piece, offset in the range, size) for the pieces of [begin, begin + size).
template <class Use>
void walk(const std::vector<Offset>& end, Offset begin, Offset size, Use&& use) {
  auto piece = static_cast<std::size_t>(std::upper_bound(end.begin(), end.end(), begin) - end.begin());
  for (Offset done = 0; done < size; ++piece) {
    const Offset start = piece == 0 ? 0 : end[piece - 1];
    const Offset now = std::min(end[piece], begin + size) - (begin + done);
    use(piece, begin + done - start, done, now);
    done += now;
  }
}

}  // namespace

void HostPieces::clear() {
  at_.clear();
  end_.clear();
}

void HostPieces::add(std::byte* at, Offset bytes) {
  if (bytes == 0) return;
  end_.push_back(this->bytes() + bytes);
  at_.push_back(at);
}

template <class Use>
void HostPieces::visit(Offset begin, Offset size, base::ThreadPool& pool, Use&& use) const {
  pool.for_each_piece(size, kBytesPerPiece, [&](std::int64_t b, std::int64_t e) {
    walk(end_, begin + b, e - b, [&](std::size_t piece, Offset in_piece, Offset done, Offset now) {
      use(at_[piece] + in_piece, b + done, static_cast<std::size_t>(now));
    });
  });
}

void HostPieces::copy_to(std::byte* to, Offset begin, Offset size, base::ThreadPool& pool) const {
  visit(begin, size, pool, [&](const std::byte* at, Offset done, std::size_t n) { std::memcpy(to + done, at, n); });
}

void HostPieces::copy_from(const std::byte* from, Offset begin, Offset size, base::ThreadPool& pool) const {
  visit(begin, size, pool,
        [&](std::byte* at, Offset done, std::size_t n) { base::copy_past_cache(at, from + done, n); });
}

void ValuePieces::set(const OutOfCoreLayout& layout, const OutOfCorePlan& units, const Operation& op) {
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
void ValuePieces::gather(std::span<const T> values, T* to, Offset begin, Offset size, base::ThreadPool& pool) const {
  pool.for_each_piece(size, kValuesPerPiece, [&](std::int64_t b, std::int64_t e) {
    walk(end_, begin + b, e - b, [&](std::size_t piece, Offset in_piece, Offset done, Offset now) {
      const plan::Entry* from = plan_->entries.data() + first_[piece] + in_piece;
      for (Offset k = 0; k < now; ++k) to[b + done + k] = values[static_cast<std::size_t>(from[k].source())];
    });
  });
}

template void ValuePieces::gather(std::span<const double>, double*, Offset, Offset, base::ThreadPool&) const;
template void ValuePieces::gather(std::span<const float>, float*, Offset, Offset, base::ThreadPool&) const;

}  // namespace espalier::out_of_core

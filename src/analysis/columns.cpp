#include "analysis/columns.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "base/at.hpp"

namespace espalier::analysis {

namespace {

/// Gives every entry its place in the transpose. Every chunk of columns counts and places its entries by itself, and
/// the chunks follow each other within a row, so the result does not depend on their number.
class Transposer {
 public:
  /// @param skip_diagonal entries (j, j) get no place
  Transposer(std::span<const Offset> ptr, std::span<const Index> ind, Index n, bool skip_diagonal,
             base::ThreadPool& pool)
      : ptr_(ptr), ind_(ind), n_(n), skip_(skip_diagonal), pool_(pool) {
    // The counters of the chunks together stay below a quarter of the entries.
    const Offset affordable = std::max<Offset>(1, static_cast<Offset>(ind.size()) / (4 * std::max<Index>(1, n)));
    next_.resize(static_cast<std::size_t>(std::min<Offset>(pool.size(), affordable)));
  }

  /// ptr[i + 1]: entries of row i, added to what stands there. Then accumulate it, and call place().
  void count(std::vector<Offset>& ptr) {
    const auto chunks = static_cast<std::int64_t>(next_.size());
    pool_.for_each(chunks, [&](std::int64_t chunk) {
      auto& mine = next_[at(chunk)];
      mine.assign(at(n_), 0);
      each_entry(chunk, [&](Index, std::size_t i, Offset) { ++mine[i]; });
    });
    pool_.for_each_range(n_, 1 << 16, [&](std::int64_t begin, std::int64_t end) {
      for (auto i = at(begin); i < at(end); ++i) {
        Offset sum = 0;
        for (auto& part : next_) sum += std::exchange(part[i], sum);
        ptr[i + 1] += sum;
      }
    });
  }

  /// write(entry, its column, its place), where the places of row i begin at ptr[i]
  template <class Write>
  void place(const std::vector<Offset>& ptr, const Write& write) {
    pool_.for_each(static_cast<std::int64_t>(next_.size()), [&](std::int64_t chunk) {
      auto& mine = next_[at(chunk)];
      for (std::size_t i = 0; i < mine.size(); ++i) mine[i] += ptr[i];
      each_entry(chunk, [&](Index j, std::size_t i, Offset k) { write(k, j, mine[i]++); });
    });
  }

 private:
  [[nodiscard]] std::int64_t begin_of(std::int64_t chunk) const {
    const auto chunks = static_cast<std::int64_t>(next_.size());
    if (chunk == chunks) return n_;
    return std::lower_bound(ptr_.begin(), ptr_.end() - 1, ptr_.back() * chunk / chunks) - ptr_.begin();
  }
  template <class Body>
  void each_entry(std::int64_t chunk, const Body& body) const {
    const auto end = static_cast<Index>(begin_of(chunk + 1));
    for (auto j = static_cast<Index>(begin_of(chunk)); j < end; ++j)
      for (Offset k = ptr_[at(j)]; k < ptr_[at(j) + 1]; ++k)
        if (!skip_ || ind_[at(k)] != j) body(j, at(ind_[at(k)]), k);
  }

  std::span<const Offset> ptr_;
  std::span<const Index> ind_;
  Index n_;
  bool skip_;
  base::ThreadPool& pool_;
  std::vector<std::vector<Offset>> next_;  // per chunk and row: entries of earlier chunks, later the next place
};

}  // namespace

void accumulate(std::vector<Offset>& ptr) { std::partial_sum(ptr.begin(), ptr.end(), ptr.begin()); }

Columns transpose(const Columns& columns, Index n, base::ThreadPool& pool) {
  Columns out;
  out.own_ptr.assign(at(n) + 1, 0);
  Transposer transposer(columns.ptr, columns.ind, n, false, pool);
  transposer.count(out.own_ptr);
  accumulate(out.own_ptr);
  out.own_ind.resize(columns.ind.size());
  transposer.place(out.own_ptr, [&](Offset, Index j, Offset place) { out.own_ind[at(place)] = j; });
  out.own();
  return out;
}

FullMatrix both_triangles(const MatrixView& a, base::ThreadPool& pool) {
  FullMatrix out;
  out.ptr.assign(at(a.cols) + 1, 0);
  for (std::size_t j = 0; j < at(a.cols); ++j) out.ptr[j + 1] = a.col_ptr[j + 1] - a.col_ptr[j];
  Transposer transposer(a.col_ptr, a.row_ind, a.cols, true, pool);
  transposer.count(out.ptr);
  accumulate(out.ptr);
  out.row.resize(at(out.ptr.back()));
  out.value.resize(at(out.ptr.back()));
  std::vector<Offset> behind(at(a.cols));  // the mirrored entries of a column stand behind the stored ones
  pool.for_each_range(a.cols, 2048, [&](std::int64_t begin, std::int64_t end) {
    for (auto j = at(begin); j < at(end); ++j) {
      const auto first = a.col_ptr[j], size = a.col_ptr[j + 1] - first;
      std::copy_n(a.row_ind.begin() + first, size, out.row.begin() + out.ptr[j]);
      std::copy_n(a.values.begin() + first, size, out.value.begin() + out.ptr[j]);
      behind[j] = out.ptr[j] + size;
    }
  });
  transposer.place(behind, [&](Offset k, Index j, Offset place) {
    out.row[at(place)] = j;
    out.value[at(place)] = a.values[at(k)];
  });
  return out;
}

}  // namespace espalier::analysis

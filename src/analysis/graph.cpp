#include "analysis/graph.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <numeric>
#include <utility>

namespace espalier::analysis {

namespace {

constexpr std::int64_t kColumns = 2048;  // columns per piece of a parallel loop

/// Columns of sorted row indices without duplicates, owned or seen.
struct Columns {
  std::span<const Offset> ptr;
  std::span<const Index> ind;
  std::vector<Offset> own_ptr;
  LazyVector<Index> own_ind;

  [[nodiscard]] std::span<const Index> operator[](std::int64_t j) const {
    const auto k = static_cast<std::size_t>(j);
    return ind.subspan(static_cast<std::size_t>(ptr[k]), static_cast<std::size_t>(ptr[k + 1] - ptr[k]));
  }
  void own() {
    ptr = own_ptr;
    ind = own_ind;
  }
};

/// counts[j + 1] -> positions
void accumulate(std::vector<Offset>& ptr) { std::partial_sum(ptr.begin(), ptr.end(), ptr.begin()); }

Columns columns_of(const MatrixView& a) {
  Columns c;
  c.ptr = a.col_ptr;
  c.ind = a.row_ind;
  return c;
}

bool strictly_sorted(const Columns& c, Index n, base::ThreadPool& pool) {
  std::atomic<bool> sorted{true};
  pool.for_each_piece(n, kColumns, [&](std::int64_t begin, std::int64_t end) {
    if (!sorted.load(std::memory_order_relaxed)) return;
    for (std::int64_t j = begin; j < end; ++j) {
      const auto rows = c[j];
      for (std::size_t k = 1; k < rows.size(); ++k)
        if (rows[k] <= rows[k - 1]) return sorted.store(false, std::memory_order_relaxed);
    }
  });
  return sorted;
}

std::uint64_t mix(std::uint64_t x) {  // the finalizer of splitmix64 (Steele, Lea, Flood 2014)
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// True when the pattern is symmetric: the sums of hash(i, j) and of hash(j, i) over all entries agree (64 bits, so an
/// unsymmetric pattern passes with probability 5e-20; a transpose would cost ten times as much).
bool symmetric_pattern(const Columns& c, Index n, base::ThreadPool& pool) {
  std::atomic<std::uint64_t> total{0};
  const auto hash = [](std::uint64_t i, std::uint64_t j) { return mix((i << 32 | j) + 0x9e3779b97f4a7c15ULL); };
  pool.for_each_piece(n, kColumns, [&](std::int64_t begin, std::int64_t end) {
    std::uint64_t sum = 0;
    for (std::int64_t j = begin; j < end; ++j)
      for (const Index i : c[j]) {
        const auto r = static_cast<std::uint64_t>(i), s = static_cast<std::uint64_t>(j);
        sum += hash(r, s) - hash(s, r);
      }
    total.fetch_add(sum, std::memory_order_relaxed);
  });
  return total == 0;
}

/// A copy with row i renamed to name[i] (or i where `name` is empty), sorted, duplicates removed.
Columns sort_columns(const Columns& c, Index n, std::span<const Index> name, base::ThreadPool& pool) {
  Columns out;
  LazyVector<Index> all(c.ind.size());
  out.own_ptr.assign(static_cast<std::size_t>(n) + 1, 0);
  pool.for_each_piece(n, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t j = begin; j < end; ++j) {
      const auto rows = c[j];
      Index* const first = all.data() + c.ptr[static_cast<std::size_t>(j)];
      Index* const last = std::copy(rows.begin(), rows.end(), first);
      if (!name.empty())
        for (Index* r = first; r != last; ++r) *r = name[static_cast<std::size_t>(*r)];
      std::sort(first, last);
      out.own_ptr[static_cast<std::size_t>(j) + 1] = std::unique(first, last) - first;
    }
  });
  accumulate(out.own_ptr);
  out.own_ind.resize(static_cast<std::size_t>(out.own_ptr.back()));
  pool.for_each_piece(n, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto j = static_cast<std::size_t>(begin); j < static_cast<std::size_t>(end); ++j)
      std::copy_n(all.data() + c.ptr[j], out.own_ptr[j + 1] - out.own_ptr[j], out.own_ind.data() + out.own_ptr[j]);
  });
  out.own();
  return out;
}

/// The transpose; its columns come out sorted. Every chunk of columns counts and places its entries by itself, and the
/// chunks follow each other within a row, so the result does not depend on their number.
Columns transpose(const Columns& c, Index n, base::ThreadPool& pool) {
  const auto size = static_cast<std::size_t>(n);
  // The counters of the chunks stay below a quarter of the entries.
  const Offset affordable = std::max<Offset>(1, static_cast<Offset>(c.ind.size()) / (4 * std::max<Index>(1, n)));
  const auto chunks = static_cast<std::int64_t>(std::min<Offset>(pool.size(), affordable));
  std::vector<std::vector<std::uint32_t>> count(static_cast<std::size_t>(chunks));
  const auto begin_of = [&](std::int64_t chunk) {
    const Offset wanted = static_cast<Offset>(c.ind.size()) * chunk / chunks;
    return chunk == chunks ? n : std::lower_bound(c.ptr.begin(), c.ptr.end() - 1, wanted) - c.ptr.begin();
  };
  pool.for_each(chunks, [&](std::int64_t chunk) {
    auto& mine = count[static_cast<std::size_t>(chunk)];
    mine.assign(size, 0);
    for (std::int64_t j = begin_of(chunk); j < begin_of(chunk + 1); ++j)
      for (const Index i : c[j]) ++mine[static_cast<std::size_t>(i)];
  });
  Columns out;
  out.own_ptr.assign(size + 1, 0);
  pool.for_each_piece(n, 1 << 16, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i) {
      std::uint32_t sum = 0;
      for (auto& part : count) sum += std::exchange(part[i], sum);
      out.own_ptr[i + 1] = sum;
    }
  });
  accumulate(out.own_ptr);
  out.own_ind.resize(c.ind.size());
  pool.for_each(chunks, [&](std::int64_t chunk) {
    auto& mine = count[static_cast<std::size_t>(chunk)];
    for (std::int64_t j = begin_of(chunk); j < begin_of(chunk + 1); ++j)
      for (const Index i : c[j]) {
        const auto r = static_cast<std::size_t>(i);
        out.own_ind[static_cast<std::size_t>(out.own_ptr[r] + mine[r]++)] = static_cast<Index>(j);
      }
  });
  out.own();
  return out;
}

/// The union of two columns without `skip`, written to out where out is not null. @return its size
Offset merge_columns(std::span<const Index> a, std::span<const Index> b, Index skip, Index* out) {
  std::size_t i = 0, k = 0;
  Offset size = 0;
  while (i < a.size() || k < b.size()) {
    Index next = 0;
    if (k == b.size() || (i < a.size() && a[i] <= b[k])) {
      next = a[i++];
      if (k < b.size() && b[k] == next) ++k;
    } else {
      next = b[k++];
    }
    if (next == skip) continue;
    if (out != nullptr) out[size] = next;
    ++size;
  }
  return size;
}

Graph merged(const Columns& a, const Columns& b, Index n, base::ThreadPool& pool) {
  Graph g{n, std::vector<Offset>(static_cast<std::size_t>(n) + 1, 0), {}};
  pool.for_each_piece(n, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t j = begin; j < end; ++j)
      g.ptr[static_cast<std::size_t>(j) + 1] = merge_columns(a[j], b[j], static_cast<Index>(j), nullptr);
  });
  accumulate(g.ptr);
  g.adj.resize(static_cast<std::size_t>(g.ptr.back()));
  pool.for_each_piece(n, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t j = begin; j < end; ++j)
      merge_columns(a[j], b[j], static_cast<Index>(j), g.adj.data() + g.ptr[static_cast<std::size_t>(j)]);
  });
  return g;
}

Columns no_columns(Index n) {
  Columns c;
  c.own_ptr.assign(static_cast<std::size_t>(n) + 1, 0);
  c.own();
  return c;
}

/// name[i]: the column to whose diagonal the row i moves; empty for the identity.
std::vector<Index> row_names(std::span<const Index> row_of_col, Index n) {
  std::vector<Index> name(row_of_col.size(), -1);
  bool identity = true;
  for (Index j = 0; j < static_cast<Index>(row_of_col.size()); ++j) {
    const Index i = row_of_col[static_cast<std::size_t>(j)];
    identity = identity && i == j;
    if (i >= 0) name[static_cast<std::size_t>(i)] = j;
  }
  if (identity) return {};
  Index free = 0;
  for (Index j = 0; j < n; ++j) {
    if (row_of_col[static_cast<std::size_t>(j)] >= 0) continue;
    while (name[static_cast<std::size_t>(free)] >= 0) ++free;
    name[static_cast<std::size_t>(free)] = j;
  }
  return name;
}

}  // namespace

Graph graph_of(const MatrixView& a, base::ThreadPool& pool, std::span<const Index> row_of_col) {
  const Index n = a.cols;
  if (n == 0) return {0, {0}, {}};
  const std::vector<Index> name = row_names(row_of_col, n);
  Columns columns = columns_of(a);
  if (!name.empty() || !strictly_sorted(columns, n, pool)) columns = sort_columns(columns, n, name, pool);
  const bool both = a.storage == Storage::general || a.storage == Storage::symmetric_both;
  if (both && symmetric_pattern(columns, n, pool)) return merged(columns, no_columns(n), n, pool);
  return merged(columns, transpose(columns, n, pool), n, pool);
}

}  // namespace espalier::analysis

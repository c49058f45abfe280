#include "analysis/ordering/graph.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <numeric>
#include <utility>

#include "analysis/columns.hpp"
#include "base/mix.hpp"

namespace espalier::analysis {

namespace {

constexpr std::int64_t kGraphRange = 2048;  // columns per range of a parallel loop

Columns columns_of(const MatrixView& a) {
  Columns c;
  c.ptr = a.col_ptr;
  c.ind = a.row_ind;
  return c;
}

Columns columns_of(const matrix::RowIndex& rows) {
  Columns c;
  c.ptr = rows.ptr;
  c.ind = {rows.col.data(), at(rows.ptr.back())};
  return c;
}

bool strictly_sorted(const Columns& c, Index n, base::ThreadPool& pool) {
  std::atomic<bool> sorted{true};
  pool.for_each_range(n, kGraphRange, [&](std::int64_t begin, std::int64_t end) {
    if (!sorted.load(std::memory_order_relaxed)) return;
    for (std::int64_t j = begin; j < end; ++j) {
      const auto rows = c[j];
      for (std::size_t k = 1; k < rows.size(); ++k)
        if (rows[k] <= rows[k - 1]) return sorted.store(false, std::memory_order_relaxed);
    }
  });
  return sorted;
}

/// True when the pattern is symmetric: the sums of hash(i, j) and of hash(j, i) over all entries agree (64 bits, so an
/// unsymmetric pattern passes with probability 5e-20; a transpose would cost ten times as much).
bool symmetric_pattern(const Columns& c, Index n, base::ThreadPool& pool) {
  std::atomic<std::uint64_t> total{0};
  const auto hash = [](std::uint64_t i, std::uint64_t j) { return base::mix((i << 32 | j) + 0x9e3779b97f4a7c15ULL); };
  pool.for_each_range(n, kGraphRange, [&](std::int64_t begin, std::int64_t end) {
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
  base::LazyVector<Index> all(c.ind.size());
  out.own_ptr.assign(at(n) + 1, 0);
  pool.for_each_range(n, kGraphRange, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t j = begin; j < end; ++j) {
      const auto rows = c[j];
      Index* const first = all.data() + c.ptr[at(j)];
      Index* const last = std::copy(rows.begin(), rows.end(), first);
      if (!name.empty())
        for (Index* r = first; r != last; ++r) *r = name[at(*r)];
      std::sort(first, last);
      out.own_ptr[at(j) + 1] = std::unique(first, last) - first;
    }
  });
  accumulate(out.own_ptr);
  out.own_ind.resize(at(out.own_ptr.back()));
  pool.for_each_range(n, kGraphRange, [&](std::int64_t begin, std::int64_t end) {
    for (auto j = at(begin); j < at(end); ++j)
      std::copy_n(all.data() + c.ptr[j], out.own_ptr[j + 1] - out.own_ptr[j], out.own_ind.data() + out.own_ptr[j]);
  });
  out.own();
  return out;
}

/// The union of two columns without `skip`, written to out where out is not null. @return its size
Offset merge_columns(std::span<const Index> a, std::span<const Index> b, Index skip, Index* out) {
  std::size_t i = 0, k = 0;
  Offset size = 0;
  const auto append = [&](Index next) {
    if (next == skip) return;
    if (out != nullptr) out[size] = next;
    ++size;
  };
  while (i < a.size() && k < b.size()) {
    const Index next = std::min(a[i], b[k]);
    i += a[i] == next ? 1 : 0;
    k += b[k] == next ? 1 : 0;
    append(next);
  }
  for (; i < a.size(); ++i) append(a[i]);
  for (; k < b.size(); ++k) append(b[k]);
  return size;
}

/// The same, fast where a stands before `skip` and b behind it, as in the two triangles of a symmetric matrix.
Offset join_columns(std::span<const Index> a, std::span<const Index> b, Index skip, Index* out) {
  if (!a.empty() && a.back() == skip) a = a.first(a.size() - 1);
  if (!b.empty() && b.front() == skip) b = b.subspan(1);
  const bool around = (a.empty() || a.back() < skip) && (b.empty() || b.front() > skip);
  if (!around) return merge_columns(a, b, skip, out);
  if (out != nullptr) std::copy(b.begin(), b.end(), std::copy(a.begin(), a.end(), out));
  return static_cast<Offset>(a.size() + b.size());
}

Graph merged(const Columns& a, const Columns& b, Index n, base::ThreadPool& pool) {
  Graph g{n, std::vector<Offset>(at(n) + 1, 0), {}};
  pool.for_each_range(n, kGraphRange, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t j = begin; j < end; ++j)
      g.ptr[at(j) + 1] = join_columns(a[j], b[j], static_cast<Index>(j), nullptr);
  });
  accumulate(g.ptr);
  g.adj.resize(at(g.ptr.back()));
  pool.for_each_range(n, kGraphRange, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t j = begin; j < end; ++j)
      join_columns(a[j], b[j], static_cast<Index>(j), g.adj.data() + g.ptr[at(j)]);
  });
  return g;
}

Columns no_columns(Index n) {
  Columns c;
  c.own_ptr.assign(at(n) + 1, 0);
  c.own();
  return c;
}

/// name[i]: the column to whose diagonal the row i moves; empty for the identity.
std::vector<Index> row_names(std::span<const Index> row_of_col, Index n) {
  std::vector<Index> name(row_of_col.size(), -1);
  bool identity = true;
  for (Index j = 0; j < static_cast<Index>(row_of_col.size()); ++j) {
    const Index i = row_of_col[at(j)];
    identity = identity && i == j;
    if (i >= 0) name[at(i)] = j;
  }
  if (identity) return {};
  Index free = 0;
  for (Index j = 0; j < n; ++j) {
    if (row_of_col[at(j)] >= 0) continue;
    while (name[at(free)] >= 0) ++free;
    name[at(free)] = j;
  }
  return name;
}

}  // namespace

Graph graph_of(const MatrixView& a, base::ThreadPool& pool, std::span<const Index> row_of_col,
               const matrix::RowIndex* rows) {
  const Index n = a.cols;
  if (n == 0) return {0, {0}, {}};
  const std::vector<Index> name = row_names(row_of_col, n);
  Columns columns = columns_of(a);
  const bool sorted = name.empty() && strictly_sorted(columns, n, pool);
  if (!sorted) columns = sort_columns(columns, n, name, pool);
  const bool both = a.storage == Storage::general || a.storage == Storage::symmetric_both;
  if (both && symmetric_pattern(columns, n, pool)) return merged(columns, no_columns(n), n, pool);
  // The index of sorted columns without duplicates is their transpose, but for the diagonal.
  const bool indexed = sorted && rows != nullptr && !rows->ptr.empty() && a.storage != Storage::symmetric_both;
  const Columns transposed = indexed ? columns_of(*rows) : transpose(columns, n, pool);
  if (a.storage == Storage::symmetric_lower) return merged(transposed, columns, n, pool);
  return merged(columns, transposed, n, pool);
}

}  // namespace espalier::analysis

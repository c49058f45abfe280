#include "matrix/triplets.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <utility>

#include "base/parallel.hpp"

namespace espalier::matrix {

namespace {

constexpr Offset kInsertionSort = 24;   // up to here insertion beats std::stable_sort with its scratch memory
constexpr Index kColumnsPerTask = 512;  // enough columns of 10 to 100 entries to hide the cost of taking a task

// The place of an entry after folding into the lower triangle where that is asked for.
struct Place {
  Index row, col;
};
inline Place place_of(const TripletView& t, std::size_t k) {
  const Index r = t.row[k], c = t.col[k];
  if (t.storage == Storage::symmetric_lower && r < c) return {c, r};
  return {r, c};
}

bool within(Index i, Index begin, Index end) { return i >= begin && i < end; }

// Columns [first[w], first[w + 1]) belong to worker w; about equal numbers of entries by `col_ptr`.
std::vector<Index> balanced_ranges(const std::vector<Offset>& col_ptr, int workers) {
  const Index cols = static_cast<Index>(col_ptr.size()) - 1;
  std::vector<Index> first(static_cast<std::size_t>(workers) + 1, cols);
  first[0] = 0;
  for (int w = 1; w < workers; ++w) {
    const Offset target = col_ptr.back() / workers * w;
    const auto at = std::lower_bound(col_ptr.begin(), col_ptr.end(), target) - col_ptr.begin();
    first[static_cast<std::size_t>(w)] =
        std::clamp(static_cast<Index>(at), first[static_cast<std::size_t>(w) - 1], cols);
  }
  return first;
}

// Every worker sweeps over all entries and counts those of its own columns: no atomics, no private histograms.
std::vector<Offset> count_columns(const TripletView& t, base::ThreadPool* pool) {
  std::vector<Offset> col_ptr(static_cast<std::size_t>(t.cols) + 1, 0);
  const int workers = base::threads_of(pool);
  base::for_each(pool, workers, [&](std::int64_t w) {
    const auto begin = static_cast<Index>(static_cast<Offset>(t.cols) * w / workers);
    const auto end = static_cast<Index>(static_cast<Offset>(t.cols) * (w + 1) / workers);
    for (std::size_t k = 0; k < t.row.size(); ++k) {
      const Index c = place_of(t, k).col;
      if (within(c, begin, end)) ++col_ptr[static_cast<std::size_t>(c) + 1];
    }
  });
  for (std::size_t j = 0; j < static_cast<std::size_t>(t.cols); ++j) col_ptr[j + 1] += col_ptr[j];
  return col_ptr;
}

void scatter(const TripletView& t, SparseMatrix& a, base::ThreadPool* pool) {
  std::vector<Offset> next(a.col_ptr.begin(), a.col_ptr.end() - 1);
  const auto first = balanced_ranges(a.col_ptr, base::threads_of(pool));
  const bool pattern = t.value.empty();
  std::atomic<bool> bad{false};
  base::for_each(pool, base::threads_of(pool), [&](std::int64_t w) {
    const Index begin = first[static_cast<std::size_t>(w)], end = first[static_cast<std::size_t>(w) + 1];
    for (std::size_t k = 0; k < t.row.size(); ++k) {
      const Place p = place_of(t, k);
      if (!within(p.col, begin, end)) continue;
      if (!within(p.row, 0, t.rows)) bad = true;
      const auto at = static_cast<std::size_t>(next[static_cast<std::size_t>(p.col)]++);
      a.row_ind[at] = p.row;
      if (!pattern) a.values[at] = t.value[k];
    }
  });
  if (bad) throw Error(StatusCode::invalid_input, fmt::format("a row index is outside 0..{}", t.rows - 1));
}

// Stable sort of `size` rows with their values (values may be null).
void sort_by_row(Index* rows, double* values, Offset size, std::vector<std::pair<Index, double>>& scratch) {
  if (size <= kInsertionSort) {
    for (Offset i = 1; i < size; ++i) {
      const Index r = rows[i];
      const double v = values != nullptr ? values[i] : 0.0;
      Offset k = i;
      for (; k > 0 && rows[k - 1] > r; --k) {
        rows[k] = rows[k - 1];
        if (values != nullptr) values[k] = values[k - 1];
      }
      rows[k] = r;
      if (values != nullptr) values[k] = v;
    }
    return;
  }
  scratch.resize(static_cast<std::size_t>(size));
  for (Offset i = 0; i < size; ++i)
    scratch[static_cast<std::size_t>(i)] = {rows[i], values != nullptr ? values[i] : 0.0};
  std::stable_sort(scratch.begin(), scratch.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (Offset i = 0; i < size; ++i) {
    rows[i] = scratch[static_cast<std::size_t>(i)].first;
    if (values != nullptr) values[i] = scratch[static_cast<std::size_t>(i)].second;
  }
}

// Sums neighbours of equal row; returns how many entries remain.
Offset sum_sorted(Index* rows, double* values, Offset size) {
  Offset kept = 0;
  for (Offset i = 0; i < size; ++i) {
    if (kept > 0 && rows[kept - 1] == rows[i]) {
      if (values != nullptr) values[kept - 1] += values[i];
      continue;
    }
    rows[kept] = rows[i];
    if (values != nullptr) values[kept] = values[i];
    ++kept;
  }
  return kept;
}

// Moves the columns together after some have shrunk to `kept` entries.
void close_gaps(SparseMatrix& a, const std::vector<Offset>& kept) {
  Offset to = 0;
  const bool pattern = a.values.empty();
  for (std::size_t j = 0; j < static_cast<std::size_t>(a.cols); ++j) {
    const Offset from = a.col_ptr[j];
    std::copy_n(a.row_ind.begin() + from, kept[j], a.row_ind.begin() + to);
    if (!pattern) std::copy_n(a.values.begin() + from, kept[j], a.values.begin() + to);
    a.col_ptr[j] = to;
    to += kept[j];
  }
  a.col_ptr[static_cast<std::size_t>(a.cols)] = to;
  a.row_ind.resize(static_cast<std::size_t>(to));
  if (!pattern) a.values.resize(static_cast<std::size_t>(to));
}

}  // namespace

SparseMatrix to_csc(const TripletView& t, base::ThreadPool* pool) {
  if (t.row.size() != t.col.size() || (!t.value.empty() && t.value.size() != t.row.size()))
    throw std::invalid_argument(fmt::format("to_csc: {} rows, {} columns and {} values were given", t.row.size(),
                                            t.col.size(), t.value.size()));
  if (t.storage != Storage::general && t.storage != Storage::symmetric_lower)
    throw std::invalid_argument("to_csc: the storage must be general or symmetric_lower");
  SparseMatrix a{t.rows, t.cols, count_columns(t, pool), {}, {}, t.storage};
  if (a.col_ptr.back() != static_cast<Offset>(t.row.size()))
    throw Error(StatusCode::invalid_input, fmt::format("a column index is outside 0..{}", t.cols - 1));
  a.row_ind.resize(t.row.size());
  a.values.resize(t.value.size());
  scatter(t, a, pool);
  sum_duplicates_sorted(a, pool);
  return a;
}

bool is_sorted_unique(const MatrixView& a) {
  for (std::size_t j = 0; j < static_cast<std::size_t>(a.cols); ++j)
    for (Offset p = a.col_ptr[j] + 1; p < a.col_ptr[j + 1]; ++p)
      if (a.row_ind[static_cast<std::size_t>(p) - 1] >= a.row_ind[static_cast<std::size_t>(p)]) return false;
  return true;
}

void sum_duplicates_sorted(SparseMatrix& a, base::ThreadPool* pool) {
  std::vector<Offset> kept(static_cast<std::size_t>(a.cols));
  std::atomic<bool> shrunk{false};
  base::for_each_range(pool, a.cols, kColumnsPerTask, [&](std::int64_t begin, std::int64_t end) {
    std::vector<std::pair<Index, double>> scratch;
    for (std::int64_t j = begin; j < end; ++j) {
      const Offset first = a.col_ptr[static_cast<std::size_t>(j)];
      const Offset size = a.col_ptr[static_cast<std::size_t>(j) + 1] - first;
      Index* rows = a.row_ind.data() + first;
      double* values = a.values.empty() ? nullptr : a.values.data() + first;
      if (!std::is_sorted(rows, rows + size)) sort_by_row(rows, values, size, scratch);
      kept[static_cast<std::size_t>(j)] = sum_sorted(rows, values, size);
      if (kept[static_cast<std::size_t>(j)] != size) shrunk = true;
    }
  });
  if (shrunk) close_gaps(a, kept);
}

}  // namespace espalier::matrix

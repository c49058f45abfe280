#include "matrix/transform.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "base/at.hpp"
#include "matrix/triplets.hpp"

namespace espalier::matrix {

namespace {

// Running sums of counts that stand one place to the right: counts of column j in ptr[j + 1].
void accumulate(std::vector<Offset>& ptr) {
  for (std::size_t j = 1; j < ptr.size(); ++j) ptr[j] += ptr[j - 1];
}

SparseMatrix copy_of(const MatrixView& a) {
  return {a.rows,
          a.cols,
          {a.col_ptr.begin(), a.col_ptr.end()},
          {a.row_ind.begin(), a.row_ind.end()},
          {a.values.begin(), a.values.end()},
          a.storage};
}

SparseMatrix empty_like(const MatrixView& a, Offset nonzeros, Index rows, Index cols, Storage storage) {
  SparseMatrix b;
  b.rows = rows;
  b.cols = cols;
  b.storage = storage;
  b.row_ind.resize(at(nonzeros));
  if (!a.values.empty()) b.values.resize(at(nonzeros));
  return b;
}

Storage transposed(Storage s) {
  if (s == Storage::symmetric_lower) return Storage::symmetric_upper;
  if (s == Storage::symmetric_upper) return Storage::symmetric_lower;
  return s;
}

SparseMatrix drop_upper(const MatrixView& a) {
  SparseMatrix b;
  b.rows = a.rows;
  b.cols = a.cols;
  b.storage = Storage::symmetric_lower;
  b.col_ptr.assign(at(a.cols) + 1, 0);
  for (Index j = 0; j < a.cols; ++j) {
    for (Offset p = a.col_ptr[at(j)]; p < a.col_ptr[at(j) + 1]; ++p) {
      if (a.row_ind[at(p)] < j) continue;
      b.row_ind.push_back(a.row_ind[at(p)]);
      if (!a.values.empty()) b.values.push_back(a.values[at(p)]);
    }
    b.col_ptr[at(j) + 1] = static_cast<Offset>(b.row_ind.size());
  }
  return b;
}

}  // namespace

SparseMatrix transpose(const MatrixView& a) {
  SparseMatrix b = empty_like(a, a.nonzeros(), a.cols, a.rows, transposed(a.storage));
  b.col_ptr.assign(at(a.rows) + 1, 0);
  for (const Index i : a.row_ind) ++b.col_ptr[at(i) + 1];
  accumulate(b.col_ptr);
  std::vector<Offset> next(b.col_ptr.begin(), b.col_ptr.end() - 1);
  for (Index j = 0; j < a.cols; ++j)
    for (Offset p = a.col_ptr[at(j)]; p < a.col_ptr[at(j) + 1]; ++p) {
      const Offset q = next[at(a.row_ind[at(p)])]++;
      b.row_ind[at(q)] = j;
      if (!a.values.empty()) b.values[at(q)] = a.values[at(p)];
    }
  return b;
}

SparseMatrix expand_lower(const MatrixView& l, double sign) {
  std::vector<Offset> col_ptr(at(l.cols) + 1, 0);
  for (Index j = 0; j < l.cols; ++j)
    for (Offset p = l.col_ptr[at(j)]; p < l.col_ptr[at(j) + 1]; ++p) {
      ++col_ptr[at(j) + 1];
      if (l.row_ind[at(p)] != j) ++col_ptr[at(l.row_ind[at(p)]) + 1];
    }
  accumulate(col_ptr);
  SparseMatrix b = empty_like(l, col_ptr.back(), l.rows, l.cols, Storage::general);
  b.col_ptr = std::move(col_ptr);
  std::vector<Offset> next(b.col_ptr.begin(), b.col_ptr.end() - 1);
  const auto add_entry = [&](Index i, Index j, Offset from, double factor) {
    const Offset q = next[at(j)]++;
    b.row_ind[at(q)] = i;
    if (!l.values.empty()) b.values[at(q)] = factor * l.values[at(from)];
  };
  // Column j is complete above the diagonal when its own turn comes: all smaller columns have passed.
  for (Index j = 0; j < l.cols; ++j)
    for (Offset p = l.col_ptr[at(j)]; p < l.col_ptr[at(j) + 1]; ++p) {
      const Index i = l.row_ind[at(p)];
      add_entry(i, j, p, 1.0);
      if (i != j) add_entry(j, i, p, sign);
    }
  return b;
}

SparseMatrix to_lower(const MatrixView& a, base::ThreadPool* pool) {
  if (!a.symmetric()) throw std::invalid_argument("to_lower: the matrix is general");
  SparseMatrix b = a.storage == Storage::symmetric_lower   ? copy_of(a)
                   : a.storage == Storage::symmetric_upper ? transpose(a)
                                                           : drop_upper(a);
  sum_duplicates_sorted(b, pool);
  return b;
}

SparseMatrix to_general(const MatrixView& a, base::ThreadPool* pool) {
  if (a.storage == Storage::general || a.storage == Storage::symmetric_both) {
    SparseMatrix b = copy_of(a);
    b.storage = Storage::general;
    if (a.storage == Storage::symmetric_both) sum_duplicates_sorted(b, pool);
    return b;
  }
  if (a.storage == Storage::symmetric_lower && is_sorted_unique(a)) return expand_lower(a, 1.0);
  return expand_lower(to_lower(a, pool), 1.0);
}

std::vector<Index> invert_permutation(std::span<const Index> order) {
  const auto n = static_cast<Index>(order.size());
  std::vector<Index> inverse(order.size(), -1);
  for (Index k = 0; k < n; ++k) {
    const Index i = order[at(k)];
    if (i < 0 || i >= n || inverse[at(i)] != -1)
      throw std::invalid_argument(fmt::format("not a permutation of 0..{}: entry {} is {}", n - 1, k, i));
    inverse[at(i)] = k;
  }
  return inverse;
}

SparseMatrix permute_symmetric(const MatrixView& a, std::span<const Index> order, base::ThreadPool* pool) {
  if (a.rows != a.cols || at(a.rows) != order.size())
    throw std::invalid_argument(
        fmt::format("permute_symmetric: {} x {} matrix, permutation of {}", a.rows, a.cols, order.size()));
  if (a.storage == Storage::symmetric_both) return permute_symmetric(to_lower(a, pool), order, pool);
  const auto place = invert_permutation(order);
  const bool fold = a.symmetric();
  const auto new_place = [&](Index i, Index j) {
    const Index r = place[at(i)], c = place[at(j)];
    return fold && r < c ? std::pair{c, r} : std::pair{r, c};
  };
  SparseMatrix b = empty_like(a, a.nonzeros(), a.rows, a.cols, fold ? Storage::symmetric_lower : Storage::general);
  b.col_ptr.assign(at(a.cols) + 1, 0);
  for (Index j = 0; j < a.cols; ++j)
    for (Offset p = a.col_ptr[at(j)]; p < a.col_ptr[at(j) + 1]; ++p)
      ++b.col_ptr[at(new_place(a.row_ind[at(p)], j).second) + 1];
  accumulate(b.col_ptr);
  std::vector<Offset> next(b.col_ptr.begin(), b.col_ptr.end() - 1);
  for (Index j = 0; j < a.cols; ++j)
    for (Offset p = a.col_ptr[at(j)]; p < a.col_ptr[at(j) + 1]; ++p) {
      const auto [r, c] = new_place(a.row_ind[at(p)], j);
      const Offset q = next[at(c)]++;
      b.row_ind[at(q)] = r;
      if (!a.values.empty()) b.values[at(q)] = a.values[at(p)];
    }
  sum_duplicates_sorted(b, pool);
  return b;
}

}  // namespace espalier::matrix

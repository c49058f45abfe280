#include "matrix/norms.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "base/at.hpp"
#include "matrix/column_sweep.hpp"
#include "matrix/triplets.hpp"

namespace espalier::matrix {

namespace {

bool half_stored(const MatrixView& a) {
  return a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper;
}

// Largest of non-negative numbers; NaN counts as infinity instead of being lost in a comparison.
double largest(const std::vector<double>& values) {
  double most = 0;
  for (const double v : values) {
    if (std::isnan(v)) return std::numeric_limits<double>::infinity();
    most = std::max(most, v);
  }
  return most;
}

// Sums of magnitudes; the vector x is not used.
struct Magnitudes {
  double value = 0;
  void add(double a, double) { value += std::abs(a); }
  void merge(const Magnitudes& other) { value += other.value; }
};

// Largest sum of magnitudes over the rows of op(A).
double largest_sum(const MatrixView& a, Transpose transpose, base::ThreadPool* pool) {
  std::vector<double> sums(at(rows_of(a, transpose)));
  const std::vector<double> unused(at(cols_of(a, transpose)));
  sum_columns<Magnitudes>(
      a, rows_of(a, transpose), pool,
      [&](Index begin, Index end, Magnitudes* m) { sweep_columns(a, transpose, unused.data(), begin, end, m); },
      [&](Index i, const Magnitudes& m) { sums[at(i)] = m.value; });
  return largest(sums);
}

// `a` itself if its columns are sorted and unique, else a sorted copy kept in `storage`.
MatrixView sorted(const MatrixView& a, SparseMatrix& copy) {
  if (is_sorted_unique(a)) return a;
  copy = {a.rows,
          a.cols,
          {a.col_ptr.begin(), a.col_ptr.end()},
          {a.row_ind.begin(), a.row_ind.end()},
          {a.values.begin(), a.values.end()},
          a.storage};
  sum_duplicates_sorted(copy);
  return copy;
}

}  // namespace

double norm_inf(const MatrixView& a, base::ThreadPool* pool) { return largest_sum(a, Transpose::no, pool); }

double norm_one(const MatrixView& a, base::ThreadPool* pool) { return largest_sum(a, Transpose::yes, pool); }

bool structure_is_symmetric(const MatrixView& a) {
  if (a.rows != a.cols) return false;
  if (half_stored(a)) return true;
  SparseMatrix copy;
  const MatrixView s = sorted(a, copy);
  // Going through the columns in order, the entries (j, i) with j > i of column i must be met one after another by
  // the entries (i, j) above the diagonal of columns j.
  std::vector<Offset> below(at(s.cols));
  for (Index j = 0; j < s.cols; ++j) {
    const auto begin = s.row_ind.begin() + s.col_ptr[at(j)], end = s.row_ind.begin() + s.col_ptr[at(j) + 1];
    for (auto p = begin; p != end && *p < j; ++p) {
      Offset& next = below[at(*p)];
      if (next == s.col_ptr[at(*p) + 1] || s.row_ind[at(next)] != j) return false;
      ++next;
    }
    below[at(j)] = std::upper_bound(begin, end, j) - s.row_ind.begin();
  }
  for (Index j = 0; j < s.cols; ++j)
    if (below[at(j)] != s.col_ptr[at(j) + 1]) return false;
  return true;
}

namespace {

// `values` stand in the pattern of s, which is sorted and unique. mirror(v): what stands on the other side of v.
template <class Value, class Mirror>
bool mirrored(const MatrixView& s, std::span<const Value> values, const Mirror& mirror) {
  std::vector<Offset> below(at(s.cols));
  const auto all_zero = [&](Offset from, Offset to) {
    return std::all_of(values.begin() + from, values.begin() + to, [](Value v) { return v == Value(0); });
  };
  for (Index j = 0; j < s.cols; ++j) {
    Offset p = s.col_ptr[at(j)];
    for (; p < s.col_ptr[at(j) + 1] && s.row_ind[at(p)] < j; ++p) {
      const Index i = s.row_ind[at(p)];
      Offset& next = below[at(i)];
      const Offset skipped = next;  // entries (k, i) with k < j that no (i, k) has met: their mirror images are absent
      while (next < s.col_ptr[at(i) + 1] && s.row_ind[at(next)] < j) ++next;
      if (!all_zero(skipped, next)) return false;
      const bool present = next < s.col_ptr[at(i) + 1] && s.row_ind[at(next)] == j;
      if (values[at(p)] != (present ? mirror(values[at(next)]) : Value(0))) return false;
      if (present) ++next;
    }
    if (p < s.col_ptr[at(j) + 1] && s.row_ind[at(p)] == j) {
      const Value v = values[at(p)];
      if (v != mirror(v) && v == v) return false;  // who looks for NaN finds it elsewhere
      ++p;
    }
    below[at(j)] = p;
  }
  for (Index j = 0; j < s.cols; ++j)
    if (!all_zero(below[at(j)], s.col_ptr[at(j) + 1])) return false;
  return true;
}

// Complex values of each entry once, in the order of sorted(a).
struct MergedValues {
  SparseMatrix real, imaginary;
  std::vector<std::complex<double>> values;
};
MergedValues merge(const MatrixView& a, std::span<const std::complex<double>> values) {
  MergedValues m;
  for (SparseMatrix* part : {&m.real, &m.imaginary}) {
    *part = {a.rows, a.cols, {a.col_ptr.begin(), a.col_ptr.end()}, {a.row_ind.begin(), a.row_ind.end()}, {}, a.storage};
    for (const std::complex<double> v : values) part->values.push_back(part == &m.real ? v.real() : v.imag());
    sum_duplicates_sorted(*part);
  }
  for (std::size_t q = 0; q < m.real.values.size(); ++q) m.values.emplace_back(m.real.values[q], m.imaginary.values[q]);
  return m;
}

}  // namespace

bool values_are_symmetric(const MatrixView& a) {
  if (a.rows != a.cols) return false;
  if (half_stored(a)) return true;
  if (a.values.empty() && a.nonzeros() > 0) return a.symmetric();
  SparseMatrix copy;
  const MatrixView s = sorted(a, copy);
  return mirrored(s, s.values, [](double v) { return v; });
}

bool values_are_symmetric(const MatrixView& a, std::span<const std::complex<double>> values, bool hermitian) {
  if (a.rows != a.cols) return false;
  if (half_stored(a)) return true;
  const auto mirror = [hermitian](std::complex<double> v) { return hermitian ? std::conj(v) : v; };
  if (is_sorted_unique(a)) return mirrored(a, values, mirror);
  const MergedValues m = merge(a, values);
  return mirrored<std::complex<double>>(m.real, m.values, mirror);
}

}  // namespace espalier::matrix

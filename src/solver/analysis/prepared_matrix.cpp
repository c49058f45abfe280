#include "solver/analysis/prepared_matrix.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <complex>
#include <functional>
#include <numeric>
#include <utility>

#include "base/at.hpp"
#include "base/scalar.hpp"
#include "matrix/norms.hpp"
#include "matrix/transform.hpp"
#include "matrix/validate.hpp"
#include "solver/analysis/analysis_file.hpp"

namespace espalier::solver {

namespace {

constexpr std::int64_t kEntries = 1 << 18;  // per range of work: 2 MiB of values

// All threads take part in the page faults of the copy.
template <class T>
void copy_array(std::span<const T> from, base::LazyVector<T>& to, base::ThreadPool& pool) {
  to.resize(from.size());
  pool.for_each_range(static_cast<std::int64_t>(from.size()), kEntries, [&](std::int64_t begin, std::int64_t end) {
    std::copy(from.begin() + begin, from.begin() + end, to.begin() + begin);
  });
}

template <class V>
Offset bytes_of(const V& v) {
  return static_cast<Offset>(v.capacity() * sizeof(typename V::value_type));
}

// Whether some entry of `a` stands twice. Columns in order show it by themselves.
bool has_duplicates(const MatrixView& a, base::ThreadPool& pool) {
  constexpr std::int64_t kColumns = 4096;  // per range of work
  std::atomic<bool> sorted{true};
  pool.for_each_range(a.cols, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto c = static_cast<std::size_t>(begin); c < static_cast<std::size_t>(end); ++c) {
      const auto first = a.row_ind.begin() + a.col_ptr[c], last = a.row_ind.begin() + a.col_ptr[c + 1];
      if (std::adjacent_find(first, last, std::greater_equal<>()) != last)
        return sorted.store(false, std::memory_order_relaxed);
    }
  });
  if (sorted) return false;
  std::vector<Index> seen(static_cast<std::size_t>(a.rows), -1);  // the last column in which the row was met
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q)
      if (std::exchange(seen[a.row_ind[q]], c) == c) return true;
  return false;
}

// Whether a diagonal entry of a triangle is not the first of its column (lower), or the last (upper): where it has to
// be, so that a device knows which elements of its block a real form stores.
bool diagonal_is_inside(const MatrixView& a) {
  if (a.storage != Storage::symmetric_lower && a.storage != Storage::symmetric_upper) return false;
  for (Index c = 0; c < a.cols; ++c) {
    const auto at = static_cast<std::size_t>(c);
    for (Offset q = a.col_ptr[at]; q < a.col_ptr[at + 1]; ++q) {
      const Offset end = a.storage == Storage::symmetric_lower ? a.col_ptr[at] : a.col_ptr[at + 1] - 1;
      if (a.row_ind[static_cast<std::size_t>(q)] == c && q != end) return true;
    }
  }
  return false;
}

// The pattern of `a` with each entry once, and where the caller's values go.
// @param sorts  by rows; else entries stand in the order of first appearance
void merge_duplicates(const MatrixView& a, PreparedMatrix& p, bool sorts) {
  std::vector<Offset> entry(static_cast<std::size_t>(a.rows), -1);  // of the row in the current column, if >= its start
  p.a.col_ptr.assign(1, 0);
  p.a.row_ind.clear();
  p.target.resize(static_cast<std::size_t>(a.nonzeros()));
  for (Index c = 0; c < a.cols; ++c) {
    const Offset start = p.a.col_ptr.back();
    for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) {
      Offset& at = entry[a.row_ind[q]];
      if (at < start) {
        at = static_cast<Offset>(p.a.row_ind.size());
        p.a.row_ind.push_back(a.row_ind[q]);
      }
      p.target[q] = at;
    }
    if (sorts) {
      std::sort(p.a.row_ind.begin() + start, p.a.row_ind.end());
      for (auto k = static_cast<std::size_t>(start); k < p.a.row_ind.size(); ++k)
        entry[p.a.row_ind[k]] = static_cast<Offset>(k);
      for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) p.target[q] = entry[a.row_ind[q]];
    }
    p.a.col_ptr.push_back(static_cast<Offset>(p.a.row_ind.size()));
  }
}

// Makes the symmetric pattern of `p` general and keeps the position that each entry came from.
void expand(PreparedMatrix& p) {
  const StoredMatrix a = std::move(p.a);
  const bool hermitian =
      std::exchange(p.numbers, p.numbers == base::Numbers::hermitian ? base::Numbers::complex : p.numbers) ==
      base::Numbers::hermitian;
  p.a = {a.rows, a.cols, {}, {}, {}, Storage::general};
  const bool both = a.storage == Storage::symmetric_both;
  auto& ptr = p.a.col_ptr;
  ptr.assign(static_cast<std::size_t>(a.cols) + 1, 0);
  const auto visit = [&](auto&& use) {
    for (Index c = 0; c < a.cols; ++c)
      for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q) {
        use(a.row_ind[q], c, q, false);
        if (!both && a.row_ind[q] != c) use(c, a.row_ind[q], q, true);
      }
  };
  visit([&](Index, Index c, Offset, bool) { ++ptr[c + 1]; });
  std::partial_sum(ptr.begin(), ptr.end(), ptr.begin());
  p.a.row_ind.resize(static_cast<std::size_t>(ptr.back()));
  p.source.resize(p.a.row_ind.size());
  std::vector<Offset> next(ptr.begin(), ptr.end() - 1);
  if (hermitian && !both) p.turned.resize(p.a.row_ind.size());
  visit([&](Index r, Index c, Offset q, bool mirrored) {
    const Offset at = next[c]++;
    p.a.row_ind[at] = r;
    p.source[at] = q;
    if (!p.turned.empty()) p.turned[at] = mirrored ? 1 : 0;
  });
}

}  // namespace

std::vector<double> diagonal(const MatrixView& a, base::ThreadPool& pool) {
  constexpr std::int64_t kColumns = 4096;  // per range of work
  std::vector<double> d(static_cast<std::size_t>(a.cols), 0.0);
  pool.for_each_range(a.cols, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto c = static_cast<Index>(begin); c < end; ++c)
      for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q)
        if (a.row_ind[q] == c) d[static_cast<std::size_t>(c)] += a.values[q];
  });
  return d;
}

Offset PreparedMatrix::bytes() const {
  return bytes_of(a.col_ptr) + bytes_of(a.row_ind) + bytes_of(a.values) + bytes_of(target) + bytes_of(source) +
         bytes_of(row_scale) + bytes_of(col_scale) + bytes_of(row_of_col) + bytes_of(pair) + bytes_of(zero_diagonal);
}

GivenMatrix given(const ComplexMatrixView& a) {
  GivenMatrix g(matrix::pattern_of(a), a.hermitian() ? base::Numbers::hermitian : base::Numbers::complex);
  g.a.values = {reinterpret_cast<const double*>(a.values.data()), 2 * a.values.size()};
  return g;
}

namespace {

std::span<const std::complex<double>> complex_values(std::span<const double> parts) {
  return {base::as_complex(parts.data()), parts.size() / 2};
}

}  // namespace

ComplexMatrixView complex_view(const GivenMatrix& given) {
  const MatrixView& a = given.a;
  Storage storage = a.storage;
  if (given.numbers == base::Numbers::hermitian && storage == Storage::symmetric_lower)
    storage = Storage::hermitian_lower;
  if (given.numbers == base::Numbers::hermitian && storage == Storage::symmetric_upper)
    storage = Storage::hermitian_upper;
  if (given.numbers == base::Numbers::hermitian && storage == Storage::symmetric_both)
    storage = Storage::hermitian_both;
  return {a.rows, a.cols, a.col_ptr, a.row_ind, complex_values(a.values), storage};
}

namespace {

// Whether the values of general storage are symmetric; notes where they are Hermitian. A real matrix in complex numbers
// is both: symmetric, since the next frequency makes it complex, unless llt is asked for.
bool has_symmetric_values(GivenMatrix& a, Kind wish) {
  if (a.a.symmetric()) return true;
  if (a.a.values.empty()) return matrix::structure_is_symmetric(a.a);
  if (a.numbers == base::Numbers::real) return matrix::values_are_symmetric(a.a);
  const auto values = complex_values(a.a.values);
  if (wish != Kind::llt && matrix::values_are_symmetric(a.a, values, false)) return true;
  if (!matrix::values_are_symmetric(a.a, values, true)) return false;
  a.numbers = base::Numbers::hermitian;
  return true;
}

[[noreturn]] void refuse_kind(const GivenMatrix& a, Kind wish) {
  const char* what = a.numbers == base::Numbers::real ? "symmetric"
                     : wish == Kind::llt              ? "Hermitian"
                                                      : "symmetric or Hermitian";
  throw Error(StatusCode::invalid_input,
              fmt::format("{} was asked for, but the matrix is not {}; use kind lu (or auto)",
                          wish == Kind::llt ? "llt" : "ldlt", what));
}

bool has_positive_diagonal(const GivenMatrix& a, base::ThreadPool& pool) {
  if (a.numbers == base::Numbers::real) {
    const std::vector<double> d = diagonal(a.a, pool);
    return std::all_of(d.begin(), d.end(), [](double x) { return x > 0; });
  }
  MatrixView parts = a.a;
  std::vector<double> real(a.a.values.size() / 2);
  for (std::size_t q = 0; q < real.size(); ++q) real[q] = a.a.values[2 * q];
  parts.values = real;
  const std::vector<double> d = diagonal(parts, pool);
  return std::all_of(d.begin(), d.end(), [](double x) { return x > 0; });
}

}  // namespace

std::vector<double> magnitudes(base::Numbers numbers, std::span<const double> values) {
  if (numbers == base::Numbers::real) return {values.begin(), values.end()};
  std::vector<double> sizes(values.size() / 2);
  for (std::size_t q = 0; q < sizes.size(); ++q) sizes[q] = std::hypot(values[2 * q], values[2 * q + 1]);
  return sizes;
}

Kind choose_kind(GivenMatrix& a, Kind wish, base::ThreadPool& pool) {
  if (wish == Kind::lu) return wish;
  const bool symmetric = has_symmetric_values(a, wish);
  if (!symmetric && wish == Kind::automatic) return Kind::lu;
  if (!symmetric || (wish == Kind::llt && a.numbers == base::Numbers::complex)) refuse_kind(a, wish);
  if (a.numbers == base::Numbers::complex) return Kind::ldlt;
  if (wish != Kind::automatic) return wish;
  if (a.a.values.empty()) return Kind::llt;
  return has_positive_diagonal(a, pool) ? Kind::llt : Kind::ldlt;
}

Kind choose_kind(const MatrixView& a, Kind wish, base::ThreadPool& pool) {
  GivenMatrix real(a);
  return choose_kind(real, wish, pool);
}

PreparedMatrix prepare_matrix(const GivenMatrix& matrix, Kind kind, base::ThreadPool& pool) {
  const MatrixView& a = matrix.a;
  PreparedMatrix p;
  p.numbers = matrix.numbers;
  p.caller_nonzeros = a.nonzeros();
  p.a.rows = a.rows;
  p.a.cols = a.cols;
  p.a.storage = a.storage;
  const bool duplicates = has_duplicates(a, pool);
  const bool expands = kind == Kind::lu && a.symmetric();
  const bool sorts = p.numbers != base::Numbers::real && kind != Kind::lu && diagonal_is_inside(a);
  const bool merges = duplicates || sorts;
  if (merges || expands) p.caller_pattern = pattern_hash(a, pool);
  copy_array(a.col_ptr, p.a.col_ptr, pool);
  if (!merges) copy_array(a.row_ind, p.a.row_ind, pool);
  if (merges) merge_duplicates(a, p, sorts);
  if (expands) expand(p);
  p.symmetric_values = kind != Kind::lu && a.storage == Storage::general;
  if (p.symmetric_values) p.a.storage = Storage::symmetric_both;
  p.a.values.resize(p.a.row_ind.size() * static_cast<std::size_t>(base::parts_of(p.numbers)));
  if (!a.values.empty()) {
    copy_values(p, a.values, p.a.values, pool);
    return p;
  }
  const auto parts = static_cast<std::int64_t>(base::parts_of(p.numbers));
  pool.for_each_range(p.a.nonzeros(), kEntries, [&](std::int64_t begin, std::int64_t end) {
    for (std::int64_t q = parts * begin; q < parts * end; ++q)
      p.a.values[static_cast<std::size_t>(q)] = q % parts == 0 ? 1.0 : 0.0;
  });
  return p;
}

bool has_real_diagonal(const PreparedMatrix& p, std::span<const double> values) {
  if (p.numbers != base::Numbers::hermitian) return true;
  for (Index c = 0; c < p.n(); ++c)
    for (Offset q = p.a.col_ptr[c]; q < p.a.col_ptr[c + 1]; ++q)
      if (p.a.row_ind[q] == c && values[2 * static_cast<std::size_t>(q) + 1] != 0) return false;
  return true;
}

[[noreturn]] void refuse_entry(const PreparedMatrix& p, std::span<const double> values) {
  const auto parts = static_cast<std::size_t>(base::parts_of(p.numbers));
  for (Index c = 0; c < p.n(); ++c)
    for (Offset q = p.a.col_ptr[c]; q < p.a.col_ptr[c + 1]; ++q) {
      const double* v = &values[parts * static_cast<std::size_t>(q)];
      const double imaginary = parts == 2 ? v[1] : 0;
      const Index r = p.a.row_ind[q];
      const bool diagonal = p.numbers == base::Numbers::hermitian && r == c && imaginary != 0;
      if (std::isfinite(v[0]) && std::isfinite(imaginary) && !diagonal) continue;
      const std::string number = parts == 2 ? fmt::format("{} + {}i", v[0], imaginary) : fmt::format("{}", v[0]);
      throw Error(StatusCode::invalid_input,
                  fmt::format("entry ({}, {}) is {}{}", r, c, number,
                              diagonal ? ", but the diagonal of a Hermitian matrix is real" : ""),
                  r);
    }
  throw Error(
      StatusCode::invalid_input,
      "the values are too far from those that were analyzed: scaled like these they leave the range of the factor's "
      "numbers; call analyze() with the new values (if it was, the matrix spans too wide a range: scale its rows "
      "and columns)");
}

std::vector<Index> positions_for(const PreparedMatrix& p, std::span<const Index> order) {
  std::vector<Index> position;
  if (p.numbers != base::Numbers::hermitian) return position;
  position.resize(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) position[static_cast<std::size_t>(order[k])] = static_cast<Index>(k);
  return position;
}

std::vector<Offset> diagonal_places(const MatrixView& a, std::span<const Index> order, base::ThreadPool& pool) {
  constexpr std::int64_t kColumns = 4096;  // per range of work
  std::vector<Offset> of_column(order.size(), -1);
  pool.for_each_range(a.cols, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto c = static_cast<Index>(begin); c < end; ++c)
      for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q)
        if (a.row_ind[q] == c) of_column[c] = q;
  });
  std::vector<Offset> places(order.size());
  std::atomic<bool> complete{true};
  pool.for_each_range(a.cols, kColumns, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k)
      if ((places[k] = of_column[static_cast<std::size_t>(order[k])]) < 0)
        complete.store(false, std::memory_order_relaxed);
  });
  if (!complete) return {};
  return places;
}

std::string name_rows(std::vector<Index> rows) {
  constexpr std::size_t kNamed = 8;
  std::sort(rows.begin(), rows.end());
  std::string text = rows.size() == 1 ? "row " : "rows ";
  for (std::size_t k = 0; k < std::min(kNamed, rows.size()); ++k)
    text += fmt::format("{}{}", k == 0 ? "" : ", ", rows[k]);
  if (rows.size() > kNamed) text += fmt::format(" and {} more", rows.size() - kNamed);
  return text + " (counted from 0)";
}

}  // namespace espalier::solver

#include "solver/analysis/prepared_matrix.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <numeric>
#include <utility>

#include "analysis/matching.hpp"
#include "base/at.hpp"
#include "base/scalar.hpp"
#include "device/determinant.hpp"
#include "matrix/norms.hpp"
#include "matrix/transform.hpp"
#include "matrix/validate.hpp"
#include "solver/analysis/analysis_file.hpp"

namespace espalier::solver {

namespace {

constexpr std::int64_t kEntries = 1 << 18;  // per range of work: 2 MiB of values

// All threads take part in the page faults of the copy.
template <class T>
void copy_array(std::span<const T> from, analysis::LazyVector<T>& to, base::ThreadPool& pool) {
  to.resize(from.size());
  pool.for_each_range(static_cast<std::int64_t>(from.size()), kEntries, [&](std::int64_t begin, std::int64_t end) {
    std::copy(from.begin() + begin, from.begin() + end, to.begin() + begin);
  });
}

template <class T>
bool equal_arrays(std::span<const T> x, std::span<const T> y, base::ThreadPool& pool) {
  if (x.size() != y.size()) return false;
  std::atomic<bool> equal{true};
  pool.for_each_range(static_cast<std::int64_t>(x.size()), kEntries, [&](std::int64_t begin, std::int64_t end) {
    if (!std::equal(x.begin() + begin, x.begin() + end, y.begin() + begin))
      equal.store(false, std::memory_order_relaxed);
  });
  return equal;
}

template <class V>
Offset bytes_of(const V& v) {
  return static_cast<Offset>(v.capacity() * sizeof(typename V::value_type));
}

// Sums of the diagonal entries of each column.
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

// The pattern of `a` with each entry once (in the order of first appearance), and where the caller's values go.
void merge_duplicates(const MatrixView& a, PreparedMatrix& p) {
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

// Rows that no column is matched to.
std::vector<Index> unmatched_rows(const std::vector<Index>& row_of_col) {
  std::vector<char> matched(row_of_col.size(), 0);
  for (const Index r : row_of_col)
    if (r >= 0) matched[r] = 1;
  std::vector<Index> rows;
  for (std::size_t r = 0; r < matched.size(); ++r)
    if (matched[r] == 0) rows.push_back(static_cast<Index>(r));
  return rows;
}

[[noreturn]] void refuse_unmatched(const std::vector<Index>& rows, Index n) {
  throw Error(
      StatusCode::singular,
      fmt::format("the matrix is structurally singular: at most {} of its {} rows can be matched to columns with "
                  "nonzero entries, without partner: {}; remove or complete them",
                  n - static_cast<Index>(rows.size()), n, name_rows(rows)),
      rows.empty() ? -1 : rows.front());
}

// Sign of the permutation p; empty: identity.
double permutation_sign(const std::vector<Index>& p) {
  std::vector<char> seen(p.size(), 0);
  double sign = 1;
  for (std::size_t k = 0; k < p.size(); ++k) {
    if (seen[k] != 0) continue;
    seen[k] = 1;
    for (auto q = static_cast<std::size_t>(p[k]); q != k; q = static_cast<std::size_t>(p[q])) {
      seen[q] = 1;
      sign = -sign;
    }
  }
  return sign;
}

}  // namespace

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
  if (duplicates || expands) p.caller_pattern = pattern_hash(a, pool);
  copy_array(a.col_ptr, p.a.col_ptr, pool);
  if (!duplicates) copy_array(a.row_ind, p.a.row_ind, pool);
  if (duplicates) merge_duplicates(a, p);
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

namespace {

template <class Value>
void copy_numbers(const PreparedMatrix& p, const Value* from, Value* to, base::ThreadPool& pool) {
  std::vector<Value> sums;
  if (!p.target.empty()) {
    const Offset most = *std::max_element(p.target.begin(), p.target.end());
    sums.assign(static_cast<std::size_t>(most) + 1, Value(0));
    for (std::size_t q = 0; q < p.target.size(); ++q) sums[static_cast<std::size_t>(p.target[q])] += from[q];
    from = sums.data();
  }
  pool.for_each_range(p.a.nonzeros(), kEntries, [&](std::int64_t begin, std::int64_t end) {
    if (p.source.empty()) {
      std::copy(from + begin, from + end, to + begin);
      return;
    }
    for (auto q = static_cast<std::size_t>(begin); q < static_cast<std::size_t>(end); ++q) {
      const Value value = from[static_cast<std::size_t>(p.source[q])];
      to[q] = !p.turned.empty() && p.turned[q] != 0 ? base::conjugate(value) : value;
    }
  });
}

template <class Value>
std::vector<double> numbers_by_caller(const PreparedMatrix& p, const Value* values) {
  std::vector<Value> merged(values, values + p.a.nonzeros());
  if (!p.source.empty()) {
    merged.assign(static_cast<std::size_t>(*std::max_element(p.source.begin(), p.source.end())) + 1, Value(0));
    for (std::size_t q = 0; q < p.source.size(); ++q)
      if (p.turned.empty() || p.turned[q] == 0) merged[static_cast<std::size_t>(p.source[q])] = values[q];
  }
  if (!p.target.empty()) {
    std::vector<Value> all(p.target.size());
    for (std::size_t q = 0; q < p.target.size(); ++q)
      all[q] = std::exchange(merged[static_cast<std::size_t>(p.target[q])], Value(0));
    merged = std::move(all);
  }
  const double* parts = reinterpret_cast<const double*>(merged.data());
  return {parts, parts + merged.size() * static_cast<std::size_t>(base::parts_of(p.numbers))};
}

}  // namespace

void copy_values(const PreparedMatrix& p, std::span<const double> from, Values& to, base::ThreadPool& pool) {
  if (p.numbers == base::Numbers::real)
    copy_numbers(p, from.data(), to.data(), pool);
  else
    copy_numbers(p, base::as_complex(from.data()), base::as_complex(to.data()), pool);
  if (!p.symmetric_values) return;
  MatrixView general = p.a;
  general.values = to;
  general.storage = Storage::general;
  const bool hermitian = p.numbers == base::Numbers::hermitian;
  const bool same = p.numbers == base::Numbers::real
                        ? matrix::values_are_symmetric(general)
                        : matrix::values_are_symmetric(general, complex_values(general.values), hermitian);
  if (!same)
    throw Error(StatusCode::invalid_input,
                fmt::format("the matrix was analyzed as a {} one, but its new values are not {}; call analyze() again",
                            hermitian ? "Hermitian" : "symmetric", hermitian ? "Hermitian" : "symmetric"));
}

std::vector<double> values_by_caller(const PreparedMatrix& p, std::span<const double> values) {
  return base::with_numbers(p.numbers, values.data(), [&](const auto* v) { return numbers_by_caller(p, v); });
}

std::uint64_t caller_hash(const PreparedMatrix& p, base::ThreadPool& pool) {
  if (!p.source.empty() || !p.target.empty()) return p.caller_pattern;
  MatrixView a = p.a;
  if (p.symmetric_values) a.storage = Storage::general;
  return pattern_hash(a, pool);
}

bool same_pattern(const PreparedMatrix& p, const MatrixView& a, base::ThreadPool& pool) {
  if (a.rows != p.a.rows || a.cols != p.a.cols || a.nonzeros() != p.caller_nonzeros) return false;
  if (!p.source.empty() || !p.target.empty()) return pattern_hash(a, pool) == p.caller_pattern;
  const MatrixView mine = p.a;
  return equal_arrays(a.col_ptr, mine.col_ptr, pool) && equal_arrays(a.row_ind, mine.row_ind, pool);
}

namespace {

// Scaling and matching ask for magnitudes alone. Of real matrices they take the values: empty.
std::vector<double> sizes_for_scaling(base::Numbers numbers, std::span<const double> values) {
  if (numbers == base::Numbers::real) return {};
  return magnitudes(numbers, values);
}

// What a matching is to choose from where the entries that are not zero do not suffice: these by their scaled sizes,
// and stored zeros, which optimisers fill in later, behind them.
std::vector<double> sizes_with_zeros(const MatrixView& a, const std::vector<double>& row,
                                     const std::vector<double>& col) {
  constexpr double kLeast = 0x1p-20, kZero = 0x1p-40;
  std::vector<double> sizes(a.values.size());
  for (std::size_t c = 0; c < col.size(); ++c)
    for (auto q = static_cast<std::size_t>(a.col_ptr[c]); q < static_cast<std::size_t>(a.col_ptr[c + 1]); ++q) {
      const double size = std::abs(a.values[q]);
      sizes[q] =
          size > 0 ? std::clamp(size * row[static_cast<std::size_t>(a.row_ind[q])] * col[c], kLeast, 1.0) : kZero;
    }
  return sizes;
}

bool has_zeros(const MatrixView& a) { return std::find(a.values.begin(), a.values.end(), 0.0) != a.values.end(); }

// Where a matching is not complete, its scaling says little of rows and columns without partner. The scaling of Curtis
// and Reid (1972) leaves logarithms of the entries whose squares have the smallest sum: whatever the units of rows and
// columns were, it leaves the same matrix, by conjugate gradients. Then sweeps of Ruiz bring the largest to 1.
// @param a  in general storage
void balance(const MatrixView& a, std::vector<double>& row, std::vector<double>& col) {
  constexpr int kMostSteps = 200, kSweeps = 8;
  constexpr double kLittle = 1e-2, kMostLog = 1000;
  const std::size_t n = col.size();
  std::vector<double> x(2 * n, 0), residual(x), direction(x), image(x), count(x);
  const auto visit = [&](const auto& use) {
    for (std::size_t c = 0; c < n; ++c)
      for (Offset q = a.col_ptr[c]; q < a.col_ptr[c + 1]; ++q)
        if (a.values[at(q)] != 0) use(at(a.row_ind[at(q)]), n + c, std::log2(std::abs(a.values[at(q)])));
  };
  visit([&](std::size_t r, std::size_t c, double log) {
    for (const std::size_t k : {r, c}) {
      residual[k] -= log;
      ++count[k];
    }
  });
  const auto preconditioned = [&](std::size_t k) { return count[k] > 0 ? residual[k] / count[k] : 0; };
  double before = 0;
  for (int step = 0; step < kMostSteps; ++step) {
    double most = 0, product = 0, curvature = 0;
    for (std::size_t k = 0; k < 2 * n; ++k) {
      most = std::max(most, std::abs(preconditioned(k)));
      product += residual[k] * preconditioned(k);
    }
    if (!(most > kLittle)) break;
    for (std::size_t k = 0; k < 2 * n; ++k)
      direction[k] = preconditioned(k) + (before > 0 ? product / before * direction[k] : 0);
    before = product;
    std::fill(image.begin(), image.end(), 0);
    visit([&](std::size_t r, std::size_t c, double) {
      const double sum = direction[r] + direction[c];
      image[r] += sum;
      image[c] += sum;
    });
    for (std::size_t k = 0; k < 2 * n; ++k) curvature += direction[k] * image[k];
    if (!(curvature > 0)) break;
    for (std::size_t k = 0; k < 2 * n; ++k) {
      x[k] += product / curvature * direction[k];
      residual[k] -= product / curvature * image[k];
    }
  }
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    std::fill(image.begin(), image.end(), -std::numeric_limits<double>::infinity());
    visit([&](std::size_t r, std::size_t c, double log) {
      for (const std::size_t k : {r, c}) image[k] = std::max(image[k], log + x[r] + x[c]);
    });
    for (std::size_t k = 0; k < 2 * n; ++k)
      if (count[k] > 0) x[k] -= image[k] / 2;
  }
  for (std::size_t k = 0; k < n; ++k) {
    row[k] = std::exp2(std::clamp(x[k], -kMostLog, kMostLog));
    col[k] = std::exp2(std::clamp(x[n + k], -kMostLog, kMostLog));
  }
}

// Rows and columns alike.
void balance(const MatrixView& a, std::vector<double>& scale) {
  std::vector<double> row(scale.size());
  balance(a, row, scale);
  for (std::size_t k = 0; k < scale.size(); ++k) scale[k] = std::sqrt(row[k]) * std::sqrt(scale[k]);
}

void match_symmetric(PreparedMatrix& p, MatrixView a, bool partners_needed, base::ThreadPool& pool) {
  analysis::SymmetricMatching m = analysis::symmetric_matching(a, pool);
  p.row_scale = p.col_scale = std::move(m.scale);
  p.pair = std::move(m.pair);
  if (m.structural_rank == p.n()) return;
  balance(matrix::to_general(a), p.col_scale);
  p.row_scale = p.col_scale;
  std::vector<double> sizes;
  if (has_zeros(a)) {
    sizes = sizes_with_zeros(a, p.row_scale, p.col_scale);
    a.values = sizes;
    m = analysis::symmetric_matching(a, pool);
    p.pair = std::move(m.pair);
  }
  p.unmatched = m.structural_rank < p.n();
  if (partners_needed && p.unmatched)
    refuse_unmatched(unmatched_rows(analysis::maximum_product_matching(matrix::to_general(a)).row_of_col), p.n());
}

// Rows without partner take the columns that are left, their own where it is among these.
void match_the_rest(std::vector<Index>& row_of_col) {
  std::vector<Index> rows = unmatched_rows(row_of_col);
  std::erase_if(rows, [&](Index r) {
    const bool own = row_of_col[static_cast<std::size_t>(r)] < 0;
    if (own) row_of_col[static_cast<std::size_t>(r)] = r;
    return own;
  });
  auto next = rows.begin();
  for (Index& row : row_of_col)
    if (row < 0) row = *next++;
}

void match_general(PreparedMatrix& p, const MatrixView& a, bool partners_needed, base::ThreadPool& pool) {
  analysis::Matching m = analysis::maximum_product_matching(a, pool);
  if (m.structural_rank < p.n()) balance(a, m.row_scale, m.col_scale);
  std::vector<double> sizes;
  if (m.structural_rank < p.n() && has_zeros(a)) {
    sizes = sizes_with_zeros(a, m.row_scale, m.col_scale);
    MatrixView with_zeros = a;
    with_zeros.values = sizes;
    analysis::Matching all = analysis::maximum_product_matching(with_zeros, pool);
    m.row_of_col = std::move(all.row_of_col);
    m.structural_rank = all.structural_rank;
  }
  if (m.structural_rank < p.n()) {
    if (partners_needed) refuse_unmatched(unmatched_rows(m.row_of_col), p.n());
    p.unmatched = true;
    match_the_rest(m.row_of_col);
  }
  p.pair = analysis::pairs_for_lu(a, m, pool);
  p.row_scale = std::move(m.row_scale);
  p.col_scale = std::move(m.col_scale);
  if (p.pair.empty()) p.row_of_col = std::move(m.row_of_col);
}

}  // namespace

void refuse_zero_rows(const PreparedMatrix& p) {
  const std::vector<double> sizes = sizes_for_scaling(p.numbers, p.a.values);
  const std::span<const double> values = sizes.empty() ? std::span<const double>(p.a.values) : sizes;
  std::vector<Index> partner(static_cast<std::size_t>(p.n()), -1);
  for (Index j = 0; j < p.n(); ++j)
    for (Offset k = p.a.col_ptr[at(j)]; k < p.a.col_ptr[at(j) + 1]; ++k)
      if (values[at(k)] != 0) partner[at(j)] = j, partner[at(p.a.row_ind[at(k)])] = p.a.row_ind[at(k)];
  const std::vector<Index> rows = unmatched_rows(partner);
  if (!rows.empty()) refuse_unmatched(rows, p.n());
}

void scale_and_match(PreparedMatrix& p, Kind kind, const Options& options, base::ThreadPool& pool) {
  if (kind == Kind::llt && options.precision == Precision::fp64 && !analysis::is_wide(p.a.values, pool)) return;
  const std::vector<double> sizes = sizes_for_scaling(p.numbers, p.a.values);
  MatrixView a = p.a;
  if (!sizes.empty()) a.values = sizes;
  const bool partners_needed = options.singular == SingularMatrix::error;
  if (kind == Kind::ldlt && options.matching) {
    match_symmetric(p, a, partners_needed, pool);
  } else if (kind == Kind::lu && options.matching) {
    match_general(p, a, partners_needed, pool);
  } else {
    analysis::Scaling s = analysis::equilibrate(a);
    p.row_scale = std::move(s.row);
    p.col_scale = std::move(s.col);
  }
  if (kind == Kind::ldlt) {
    const std::vector<double> d = diagonal(a, pool);
    p.zero_diagonal.resize(d.size());
    std::transform(d.begin(), d.end(), p.zero_diagonal.begin(), [](double x) { return static_cast<char>(x == 0); });
  }
  note_determinant(p);
}

namespace {

// Logarithm of the product of all factors, and whether one is far from 1.
void measure_scales(const std::vector<double>& row, const std::vector<double>& col, double& log, bool& wide) {
  device::Determinant product;
  wide = false;
  for (const auto* scale : {&row, &col})
    for (const double s : *scale) {
      product.multiply(s);
      wide = wide || s > 0x1p300 || s < 0x1p-300;
    }
  log = product.log();
}

}  // namespace

void note_determinant(PreparedMatrix& p) {
  measure_scales(p.row_scale, p.col_scale, p.transform_log, p.wide);
  p.transform_sign = permutation_sign(p.row_of_col);
}

Scales scales_for(const PreparedMatrix& p, std::span<const double> values, bool matching, base::ThreadPool& pool) {
  MatrixView a = p.a;
  const std::vector<double> sizes = sizes_for_scaling(p.numbers, values);
  a.values = sizes.empty() ? values : sizes;
  Scales scales;
  if (matching && a.symmetric()) {
    analysis::SymmetricMatching m = analysis::symmetric_matching(a, pool);
    if (m.structural_rank < p.n()) balance(matrix::to_general(a), m.scale);
    scales.row = scales.col = std::move(m.scale);
  } else if (matching) {
    analysis::Matching m = analysis::maximum_product_matching(a, pool);
    if (m.structural_rank < p.n()) balance(a, m.row_scale, m.col_scale);
    scales.row = std::move(m.row_scale);
    scales.col = std::move(m.col_scale);
  } else {
    analysis::Scaling s = analysis::equilibrate(a);
    scales.row = std::move(s.row);
    scales.col = std::move(s.col);
  }
  measure_scales(scales.row, scales.col, scales.log, scales.wide);
  return scales;
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

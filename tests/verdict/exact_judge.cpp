#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "espalier/complex_solver.hpp"
#include "matrix/generators/random.hpp"
#include "verdict/exact.hpp"

namespace espalier::verdict {

namespace {

using Wide = std::complex<long double>;

// What is allowed of |A v| beside |A| |v|: 16 times the bound of a zero (16 eps), see solver/deficiency/deficiency.hpp.
constexpr long double kVectorError = 1e-13L, kBackwardError = 1e-14L;

bool is_hermitian(Storage s) { return s >= Storage::hermitian_lower; }

// use(row, column, value) for all entries of the full matrix.
template <class Use>
void visit(const ComplexSparseMatrix& a, Use&& use) {
  const bool mirrored = a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper ||
                        a.storage == Storage::hermitian_lower || a.storage == Storage::hermitian_upper;
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(c)]; q < a.col_ptr[static_cast<std::size_t>(c) + 1]; ++q) {
      const Index r = a.row_ind[static_cast<std::size_t>(q)];
      const std::complex<double> v = a.values[static_cast<std::size_t>(q)];
      use(r, c, v);
      if (mirrored && r != c) use(c, r, is_hermitian(a.storage) ? std::conj(v) : v);
    }
}

struct Product {
  std::vector<Wide> y;   // op(A) x
  long double size = 0;  // |op(A)|_inf |x|_inf
};
template <class Value>
Product multiply(const ComplexSparseMatrix& a, const Value* x, bool transpose) {
  const auto n = static_cast<std::size_t>(a.rows);
  Product p{std::vector<Wide>(n)};
  std::vector<long double> rows(n, 0);
  long double most = 0;
  for (std::size_t k = 0; k < n; ++k) most = std::max(most, std::abs(Wide(std::real(x[k]), std::imag(x[k]))));
  visit(a, [&](Index r, Index c, std::complex<double> v) {
    const auto i = static_cast<std::size_t>(transpose ? c : r), j = static_cast<std::size_t>(transpose ? r : c);
    const Wide z(v.real(), v.imag());
    p.y[i] += z * Wide(std::real(x[j]), std::imag(x[j]));
    rows[i] += std::abs(z);
  });
  p.size = *std::max_element(rows.begin(), rows.end()) * most;
  return p;
}

template <class Value>
long double null_error(const ComplexSparseMatrix& a, const Value* v, bool transpose) {
  const Product p = multiply(a, v, transpose);
  long double most = 0;
  for (const Wide y : p.y) most = std::max(most, std::abs(y));
  return p.size > 0 ? most / p.size : 0;
}

template <class Value>
long double backward_error(const ComplexSparseMatrix& a, const std::vector<Value>& b, const std::vector<Value>& x) {
  const Product p = multiply(a, x.data(), false);
  long double most = 0, given = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    const Wide right(std::real(b[i]), std::imag(b[i]));
    most = std::max(most, std::abs(right - p.y[i]));
    given = std::max(given, std::abs(right));
  }
  return p.size + given > 0 ? most / (p.size + given) : 0;
}

SparseMatrix as_given(const ComplexSparseMatrix& a, double) {
  SparseMatrix r{a.rows, a.cols, a.col_ptr, a.row_ind, {}, a.storage};
  for (const auto z : a.values) r.values.push_back(z.real());
  return r;
}
const ComplexSparseMatrix& as_given(const ComplexSparseMatrix& a, std::complex<double>) { return a; }

template <class Value, class Result>
std::string wrong_vectors(const ComplexSparseMatrix& a, Index zeros, const Result& f, Kind kind) {
  const auto n = static_cast<std::size_t>(a.rows);
  const auto check_vectors = [&](const std::vector<Value>& all, bool transpose) -> std::string {
    if (all.size() % n != 0 || (!all.empty() && all.size() != n * static_cast<std::size_t>(zeros)))
      return fmt::format("{} numbers in null vectors", all.size());
    for (std::size_t at = 0; at < all.size(); at += n)
      if (const long double error = null_error(a, all.data() + at, transpose); !(error < kVectorError))
        return fmt::format("|A v| is {:.1e}{}", static_cast<double>(error), transpose ? ", left" : "");
    return {};
  };
  if (f.null_vectors.empty()) return "no null vectors of a small matrix";
  if (std::string wrong = check_vectors(f.null_vectors, false); !wrong.empty()) return wrong;
  if (kind == Kind::lu && f.left_null_vectors.empty()) return "no left null vectors of a small matrix";
  return check_vectors(f.left_null_vectors, true);
}

template <class Result>
std::string wrong_report(const ExactCase& c, const Result& f, Kind kind) {
  const Index zeros = c.a.n - f.rank;
  if (!f.status.ok()) return f.status.message;
  if (zeros != c.zeros) return fmt::format("{} zeros instead of {}", zeros, c.zeros);
  if (c.negative >= 0 && f.inertia.zero >= 0 && (f.inertia.negative != c.negative || f.inertia.zero != c.zeros))
    return fmt::format("inertia ({}, {}, {}) instead of {} negative", f.inertia.positive, f.inertia.negative,
                       f.inertia.zero, c.negative);
  if (static_cast<Index>(f.dependent_rows.size()) != zeros) return "another number of dependent rows";
  if (kind == Kind::lu && static_cast<Index>(f.dependent_columns.size()) != zeros)
    return "another number of dependent columns";
  return {};
}

// The rank without the dependent rows (and columns) that were named.
template <class Result>
std::string wrong_rows(const ExactCase& c, const ComplexSparseMatrix& a, const Result& f, Kind kind,
                       const Disguise& d) {
  if (c.zeros == 0 || d.units != 0 || d.range != 0) return {};  // integers no more
  IntegerMatrix rest(c.a.n);
  visit(a, [&](Index r, Index col, std::complex<double> v) { rest.at(r, col) += v; });
  const auto& columns = kind == Kind::lu ? f.dependent_columns : f.dependent_rows;
  for (Index k = 0; k < rest.n; ++k) {
    for (const Index r : f.dependent_rows) rest.at(r, k) = 0;
    for (const Index col : columns) rest.at(k, col) = 0;
  }
  return exact_rank(rest) == c.a.n - c.zeros ? "" : "without the rows that were named the rest is singular";
}

template <class Value>
std::string judge_as(const ExactCase& c, const Disguise& d, const Options& options, std::uint64_t seed) {
  const ComplexSparseMatrix a = disguised(c, d, seed);
  const auto& given = as_given(a, Value());
  SolverOf<Value> solver(options);
  const bool reports = options.singular != SingularMatrix::error;
  const AnalysisResult analysis = solver.analyze(given);
  if (!analysis.status.ok()) {
    const bool expected = !reports && analysis.status.code == StatusCode::singular && c.zeros > 0;
    return expected ? "" : "analysis: " + analysis.status.message;
  }
  std::vector<Value> ones(static_cast<std::size_t>(a.rows)), b(ones.size()), x(ones.size());
  for (std::size_t k = 0; k < ones.size(); ++k) ones[k] = 0.5 + matrix::random_unit(seed, k);
  const Product image = multiply(a, ones.data(), false);
  for (std::size_t k = 0; k < b.size(); ++k) {
    const std::complex<double> z(static_cast<double>(image.y[k].real()), static_cast<double>(image.y[k].imag()));
    if constexpr (std::is_same_v<Value, double>)
      b[k] = z.real();
    else
      b[k] = z;
  }
  const auto f = solver.factorize(given);
  const Kind kind = solver.analysis().kind;
  if (!reports && c.zeros > 0) {
    if (f.status.code == StatusCode::singular)
      return f.rank == -1 || c.a.n - f.rank == c.zeros ? "" : "rank of an error is wrong";
    if (f.status.ok() && solver.solve(b, x).status.code == StatusCode::singular) return "late";
    return "a singular matrix was factorized: " + f.status.message;
  }
  if (std::string wrong = wrong_report(c, f, kind); !wrong.empty()) return wrong;
  if (c.zeros > 0) {
    if (std::string wrong = wrong_vectors<Value>(a, c.zeros, f, kind); !wrong.empty() && d.range == 0) return wrong;
    if (std::string wrong = wrong_rows(c, a, f, kind, d); !wrong.empty()) return wrong;
  }
  const SolveResult solved = solver.solve(b, x);
  const long double error = backward_error(a, b, x);
  if (!(error < kBackwardError))
    return fmt::format("backward error {:.1e} ({})", static_cast<double>(error), solved.status.message);
  return {};
}

}  // namespace

std::string judge(const ExactCase& c, const Disguise& d, const Options& options, std::uint64_t seed) {
  return c.complex ? judge_as<std::complex<double>>(c, d, options, seed) : judge_as<double>(c, d, options, seed);
}

Trial make_trial(const ExactCase& c, std::uint64_t seed) {
  std::uint64_t counter = 0;
  const auto below = [&](std::uint64_t n) { return matrix::random_below(seed ^ 0xabcdef, counter++, n); };
  Trial t;
  Options& o = t.options;
  o.threads = 1;
  o.singular = below(3) == 0 ? SingularMatrix::error : SingularMatrix::report;
  const bool symmetric = c.symmetry != Symmetry::general, hermitian = c.symmetry == Symmetry::hermitian;
  const std::uint64_t storage = symmetric ? below(4) : 0;
  t.disguise.storage =
      storage == 0 ? Storage::general : static_cast<Storage>(static_cast<int>(storage) + (hermitian ? 3 : 0));
  const std::uint64_t kind = below(4);
  o.kind = kind == 0 || (kind == 1 && !symmetric) ? Kind::lu : kind == 1 ? Kind::ldlt : Kind::automatic;
  o.matching = below(6) != 0;
  constexpr int kFar = 498;  // 2^498 is about 1e150
  const std::uint64_t units = below(5);
  t.disguise.units = units == 0 ? kFar : units == 1 ? -kFar : 0;
  const std::uint64_t range = below(5);
  // Without a matching nobody finds units that wander so far.
  t.disguise.range = range == 0 ? (units < 2 || !o.matching ? 10 : 200) : range == 1 ? 20 : 0;
  t.disguise.renumber = below(3) != 0;
  t.disguise.split = below(4) == 0;
  t.disguise.zeros = below(3) == 0;
  t.name = fmt::format("storage {}, kind {}, singular {}, matching {}, 2^{} 2^+-{}, renumber {}, split {}, zeros {}",
                       static_cast<int>(t.disguise.storage), static_cast<int>(o.kind), static_cast<int>(o.singular),
                       o.matching, t.disguise.units, t.disguise.range, t.disguise.renumber, t.disguise.split,
                       t.disguise.zeros);
  return t;
}

}  // namespace espalier::verdict

#include "espalier/inverse.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "base/stopwatch.hpp"
#include "inverse/entries.hpp"
#include "matrix/validate.hpp"
#include "solver/session/solver_impl.hpp"
#include "solver/session/status_of.hpp"

namespace espalier {

namespace {

using inverse::Entries;

template <class Value>
using ViewOf = std::conditional_t<std::is_same_v<Value, double>, MatrixView, ComplexMatrixView>;

template <class SolverType>
solver::Session& session_of(SolverType& solver, const char* call) {
  solver::Session& s = solver::SolverAccess::session(solver);
  if (s.state() != Solver::State::factorized)
    throw std::logic_error(fmt::format("{}: there is no factorization", call));
  if (s.link() != nullptr)
    throw std::logic_error(fmt::format(
        "{}: several ranks share the solver; entries of the inverse come from a solver of one process", call));
  return s;
}

void check_size(const char* call, std::size_t have, std::size_t need) {
  if (have != need) throw std::invalid_argument(fmt::format("{}: x has {} values, {} are needed", call, have, need));
}

template <class Value>
void check_pattern(const ViewOf<Value>& a, Index n, const char* what, solver::Session& s) {
  matrix::validate(a, &s.pool);
  if (a.rows != n || a.cols != n)
    throw Error(StatusCode::invalid_input,
                fmt::format("{} has {} rows and {} columns, the factored matrix has {}", what, a.rows, a.cols, n));
}

constexpr std::int64_t kGrain = 1 << 10;  // columns that a thread takes at a time

// use(i, j, q) for the entries that are stored in columns [begin, end).
template <class View, class Use>
void for_each_entry(const View& a, Index begin, Index end, Use&& use) {
  for (Index j = begin; j < end; ++j)
    for (Offset q = a.col_ptr[static_cast<std::size_t>(j)]; q < a.col_ptr[static_cast<std::size_t>(j) + 1]; ++q)
      use(a.row_ind[static_cast<std::size_t>(q)], j, static_cast<std::size_t>(q));
}

// In a symmetric matrix both triangles of the inverse are the same.
bool either_triangle(const solver::Session& s) {
  const solver::PreparedMatrix& p = s.current().system->prepared;
  return p.a.storage != Storage::general && p.numbers != base::Numbers::hermitian;
}

template <class Body>
void timed(solver::Session& s, InverseResult& result, Body&& body) {
  const double start = base::now_seconds();
  Status status = solver::status_of(s.interruption, "ask for fewer entries, or use a machine with more memory", [&] {
    s.expect_usable();
    body();
  });
  if (!status.ok()) result.status = std::move(status);
  result.seconds = base::now_seconds() - start;
}

template <class Value, class SolverType>
InverseResult entries_of(SolverType& solver, const ViewOf<Value>& pattern, std::span<Value> x, Transpose transpose) {
  solver::Session& s = session_of(solver, "selected_inverse");
  check_size("selected_inverse", x.size(), pattern.row_ind.size());
  InverseResult result;
  timed(s, result, [&] {
    ViewOf<Value> shape = pattern;
    shape.values = {};
    check_pattern<Value>(shape, s.current().n(), "the pattern", s);
    Entries entries(x.size());
    const bool turned = transpose != Transpose::no || either_triangle(s);
    s.pool.for_each_range(pattern.cols, kGrain, [&](std::int64_t begin, std::int64_t end) {
      for_each_entry(pattern, static_cast<Index>(begin), static_cast<Index>(end),
                     [&](Index i, Index j, std::size_t q) { turned ? entries.set(q, j, i) : entries.set(q, i, j); });
    });
    inverse::invert_entries(s, entries, x, result);
  });
  if constexpr (!std::is_same_v<Value, double>) {
    if (transpose == Transpose::conjugate)
      for (Value& v : x) v = std::conj(v);
  }
  return result;
}

template <class Value, class SolverType>
InverseResult blocks_of(SolverType& solver, const char* call, Index size, std::span<Value> x) {
  solver::Session& s = session_of(solver, call);
  const Index n = s.current().n();
  if (size < 1 || n % size != 0)
    throw std::invalid_argument(fmt::format("{}: {} unknowns are no blocks of {}", call, n, size));
  check_size(call, x.size(), static_cast<std::size_t>(n) * static_cast<std::size_t>(size));
  InverseResult result;
  timed(s, result, [&] {
    Entries entries(x.size());
    const std::int64_t entries_each = std::int64_t{size} * size;
    s.pool.for_each_range(n / size, std::max<std::int64_t>(1, kGrain / size),
                          [&](std::int64_t begin, std::int64_t end) {
                            auto at = static_cast<std::size_t>(begin * entries_each);
                            for (auto first = static_cast<Index>(begin) * size; first < end * size; first += size)
                              for (Index c = 0; c < size; ++c)
                                for (Index r = 0; r < size; ++r) entries.set(at++, first + r, first + c);
                          });
    inverse::invert_entries(s, entries, x, result);
  });
  return result;
}

// trace(A^-1 op(B)); trace(A^-1 B) = sum of (A^-1)_ji b_ij, also for the entries that the storage leaves out.
template <class Value, class SolverType>
TraceResultOf<Value> trace_of(SolverType& solver, const ViewOf<Value>& b, Transpose transpose) {
  solver::Session& s = session_of(solver, "trace_of_inverse");
  TraceResultOf<Value> result;
  timed(s, result, [&] {
    const Index n = s.current().n();
    if (b.values.size() != b.row_ind.size())
      throw Error(StatusCode::invalid_input, "B has no values: its trace with the inverse needs them");
    check_pattern<Value>(b, n, "B", s);
    const bool one_triangle = b.storage == Storage::symmetric_lower || b.storage == Storage::symmetric_upper ||
                              b.storage == Storage::hermitian_lower || b.storage == Storage::hermitian_upper;
    const bool hermitian = b.storage == Storage::hermitian_lower || b.storage == Storage::hermitian_upper;
    Entries entries;
    std::vector<Value> factors;
    const bool turned = transpose != Transpose::no && !either_triangle(s);
    const auto add = [&](Index i, Index j, Value v) {
      entries.unknown.push_back(turned ? i : j);
      entries.row.push_back(turned ? j : i);
      factors.push_back(transpose == Transpose::conjugate ? base::conjugate(v) : v);
    };
    for_each_entry(b, 0, n, [&](Index i, Index j, std::size_t q) {
      add(i, j, b.values[q]);
      if (one_triangle && i != j) add(j, i, hermitian ? base::conjugate(b.values[q]) : b.values[q]);
    });
    std::vector<Value> x(factors.size());
    const auto sum_up = [&] {
      std::vector<double> largest(static_cast<std::size_t>(n), 0);
      for (std::size_t e = 0; e < x.size(); ++e) {
        double& most = largest[static_cast<std::size_t>(entries.row[e])];
        most = std::max(most, std::abs(x[e]));
      }
      double weight = 0;
      for (std::size_t e = 0; e < x.size(); ++e) {
        result.trace += factors[e] * x[e];
        weight += std::abs(factors[e]) * largest[static_cast<std::size_t>(entries.row[e])];
      }
      result.trace_error = weight > 0 ? result.error * weight : 0;
    };
    try {
      inverse::invert_entries<Value>(s, entries, x, result);
    } catch (const Error& e) {
      if (e.status().code == StatusCode::accuracy_not_reached) sum_up();
      throw;
    }
    sum_up();
  });
  return result;
}

}  // namespace

InverseResult selected_inverse(Solver& solver, const MatrixView& pattern, std::span<double> x, Transpose transpose) {
  return entries_of<double>(solver, pattern, x, transpose);
}
InverseResult selected_inverse(ComplexSolver& solver, const ComplexMatrixView& pattern,
                               std::span<std::complex<double>> x, Transpose transpose) {
  return entries_of<std::complex<double>>(solver, pattern, x, transpose);
}
InverseResult inverse_diagonal(Solver& solver, std::span<double> x) {
  return blocks_of<double>(solver, "inverse_diagonal", 1, x);
}
InverseResult inverse_diagonal(ComplexSolver& solver, std::span<std::complex<double>> x) {
  return blocks_of<std::complex<double>>(solver, "inverse_diagonal", 1, x);
}
InverseResult inverse_blocks(Solver& solver, Index size, std::span<double> x) {
  return blocks_of<double>(solver, "inverse_blocks", size, x);
}
InverseResult inverse_blocks(ComplexSolver& solver, Index size, std::span<std::complex<double>> x) {
  return blocks_of<std::complex<double>>(solver, "inverse_blocks", size, x);
}
TraceResult trace_of_inverse(Solver& solver, const MatrixView& b, Transpose transpose) {
  return trace_of<double>(solver, b, transpose);
}
ComplexTraceResult trace_of_inverse(ComplexSolver& solver, const ComplexMatrixView& b, Transpose transpose) {
  return trace_of<std::complex<double>>(solver, b, transpose);
}

}  // namespace espalier

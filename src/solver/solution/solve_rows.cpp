#include "espalier/solve_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "base/at.hpp"
#include "base/mix.hpp"
#include "base/scalar.hpp"
#include "base/stage.hpp"
#include "base/stopwatch.hpp"
#include "solve/refinement.hpp"
#include "solver/session/session_calls.hpp"
#include "solver/session/solver_impl.hpp"
#include "solver/solution/solution.hpp"

namespace espalier {

namespace {

using solver::Factor;
using solver::Session;

constexpr Index kColumnsAtOnce = 32;  // whole solutions

// The error of a solution as the factor gives it, for random numbers between a half and one of either sign.
solve::BackwardError error_without_refinement(Factor& factor, bool transpose) {
  const auto doubles = static_cast<std::size_t>(factor.analysis()->doubles());
  std::vector<double> b(doubles), x(doubles);
  for (std::size_t i = 0; i < doubles; ++i) {
    const std::uint64_t bits = base::mix(i + 1);
    b[i] = (bits % 2 == 0 ? 1 : -1) * (0.5 + 0.5 * static_cast<double>(bits >> 11) * 0x1p-53);
  }
  solve::RefinementOptions none;
  none.steps = 0;
  const auto error_in = [&](const solve::ResidualSpace& space, const solve::Preconditioner& apply, const double* from,
                            double* to) {
    apply(from, to, 1);
    return solve::refine(space, apply, {from, to, 1, transpose}, none).error;
  };
  if (device::DeviceLinearSystem* device = factor.numeric().device_system(); device != nullptr) {
    const device::Settled settled(*device);
    double* from = device->right_hand_sides(1);
    double* to = device->solutions(1);
    device->send(from, b.data(), static_cast<Offset>(doubles));
    return error_in(
        *device,
        [&](const double* of, double* solution, Index columns) {
          device->substitute(of, solution, columns, transpose);
        },
        from, to);
  }
  return error_in(
      *factor.residual_space(),
      [&](const double* of, double* solution, Index columns) { factor.solve(of, solution, columns, transpose); },
      b.data(), x.data());
}

// Whether solutions may go without refinement and without a residual of their own.
bool trusts(Session& s, bool transpose, SolveRowsResult& result) {
  constexpr double kTrusted = 1e-10, kTrustedInSingle = 1e-4, kLimitInSingle = 1e-5;
  Factor& factor = *s.factor;
  const FactorResult& found = factor.result();
  if (found.perturbed > 0 || (found.rank >= 0 && found.rank < factor.analysis()->n()) || factor.substitutes() ||
      factor.precision() == Precision::mixed)
    return false;
  result.backward_error = result.componentwise_error = std::numeric_limits<double>::quiet_NaN();
  const double asked = s.options.required_backward_error;
  if (s.options.refinement_steps == 0 && std::isinf(asked)) return true;  // nobody looks
  const solve::BackwardError& error =
      factor.error_without_refinement(transpose, [&] { return error_without_refinement(factor, transpose); });
  result.backward_error = error.normwise;
  result.componentwise_error = error.componentwise;
  const bool single = factor.precision() == Precision::fp32;
  return error.normwise <= (single ? std::max(asked, kLimitInSingle) : asked) &&
         error.componentwise <= (single ? kTrustedInSingle : kTrusted);
}

template <class Value>
void check(const SparseColumnsOf<Value>& b, std::span<const Index> rows, std::size_t room, Index n) {
  const std::size_t columns = b.col_ptr.empty() ? 0 : b.col_ptr.size() - 1;
  if (columns < 1 || b.row_ind.size() != b.values.size() || room != rows.size() * columns)
    throw std::invalid_argument(
        fmt::format("solve_rows: {} unknowns of {} right-hand sides need {} values, x has {}; b has {} rows for {} "
                    "values",
                    rows.size(), columns, rows.size() * columns, room, b.row_ind.size(), b.values.size()));
  const auto wrong = [](const std::string& what) { throw Error(StatusCode::invalid_input, what); };
  bool ascending = b.col_ptr.front() == 0 && b.col_ptr.back() == static_cast<Offset>(b.values.size());
  for (std::size_t c = 0; c < columns; ++c) ascending &= b.col_ptr[c] <= b.col_ptr[c + 1];
  if (!ascending) wrong("the columns of the right-hand sides do not begin one after another, from 0 to the last entry");
  for (std::size_t k = 0; k < b.values.size(); ++k) {
    if (b.row_ind[k] < 0 || b.row_ind[k] >= n)
      wrong(fmt::format("entry {} of the right-hand sides stands in row {}, of {}", k, b.row_ind[k], n));
    if (!std::isfinite(std::real(b.values[k])) || !std::isfinite(std::imag(b.values[k])))
      wrong(fmt::format("entry {} of the right-hand sides, in row {}, is not finite", k, b.row_ind[k]));
  }
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (rows[k] < 0 || rows[k] >= n) wrong(fmt::format("wanted unknown {} is number {}, of {}", k, rows[k], n));
}

// With one entry for each place: the sums.
template <class Value>
struct Summed {
  std::vector<Offset> col_ptr{0};
  std::vector<Index> row_ind;
  std::vector<Value> values;

  explicit Summed(const SparseColumnsOf<Value>& b) {
    std::vector<std::size_t> entries;
    for (std::size_t c = 0; c + 1 < b.col_ptr.size(); ++c) {
      entries.resize(at(b.col_ptr[c + 1] - b.col_ptr[c]));
      std::iota(entries.begin(), entries.end(), at(b.col_ptr[c]));
      std::stable_sort(entries.begin(), entries.end(),
                       [&](std::size_t i, std::size_t j) { return b.row_ind[i] < b.row_ind[j]; });
      for (const std::size_t k : entries) {
        if (static_cast<Offset>(row_ind.size()) > col_ptr.back() && row_ind.back() == b.row_ind[k]) {
          values.back() += b.values[k];
          continue;
        }
        row_ind.push_back(b.row_ind[k]);
        values.push_back(b.values[k]);
      }
      col_ptr.push_back(static_cast<Offset>(row_ind.size()));
    }
  }
};

// Whole solutions, by chunks.
template <class Value>
void solve_whole(Session& s, const SparseColumnsOf<Value>& b, std::span<const Index> rows, std::span<Value> x,
                 bool transpose, SolveRowsResult& result) {
  const auto n = at(s.current().n()), columns = b.col_ptr.size() - 1;
  static_cast<SolveResult&>(result) = {};
  result.share = 1;
  std::vector<Value> all(n * std::min(at(kColumnsAtOnce), columns));
  for (std::size_t first = 0; first < columns; first += at(kColumnsAtOnce)) {
    const std::size_t now = std::min(at(kColumnsAtOnce), columns - first);
    std::fill(all.begin(), all.end(), Value(0));
    for (std::size_t c = 0; c < now; ++c)
      for (auto k = at(b.col_ptr[first + c]); k < at(b.col_ptr[first + c + 1]); ++k)
        all[c * n + at(b.row_ind[k])] += b.values[k];
    auto* const doubles = reinterpret_cast<double*>(all.data());
    const SolveResult one = solver::solve(*s.factor, {doubles, doubles, static_cast<Index>(now), transpose}, s.context);
    result.solve_seconds += one.solve_seconds;
    result.refinement_steps = std::max(result.refinement_steps, one.refinement_steps);
    result.backward_error = std::max(result.backward_error, one.backward_error);
    result.componentwise_error = std::max(result.componentwise_error, one.componentwise_error);
    if (!one.status.ok() && result.status.ok()) result.status = one.status;
    for (std::size_t c = 0; c < now; ++c)
      for (std::size_t k = 0; k < rows.size(); ++k) x[(first + c) * rows.size() + k] = all[c * n + at(rows[k])];
  }
}

template <class Value>
void solve_paths(Session& s, const SparseColumnsOf<Value>& b, std::span<const Index> rows, std::span<Value> x,
                 bool transpose, SolveRowsResult& result) {
  if (trusts(s, transpose, result)) {
    const double start = base::now_seconds();
    const Summed<Value> sums(b);
    const auto share =
        s.factor->numeric().solve_rows({sums.col_ptr, sums.row_ind, reinterpret_cast<const double*>(sums.values.data()),
                                        rows, reinterpret_cast<double*>(x.data()), transpose});
    if (share) {
      result.solve_seconds = base::now_seconds() - start;
      result.share = *share;
      const auto finite = [](const Value& v) { return std::isfinite(std::real(v)) && std::isfinite(std::imag(v)); };
      if (std::all_of(x.begin(), x.end(), finite)) return;
    }
  }
  solve_whole(s, b, rows, x, transpose, result);
}

template <class Value, class SolverType>
SolveRowsResult solved(SolverType& of, const SparseColumnsOf<Value>& b, std::span<const Index> rows, std::span<Value> x,
                       Transpose transpose) {
  Session& s = solver::SolverAccess::session(of);
  solver::check_factorized(s, "solve_rows");
  if (s.link() != nullptr)
    throw std::logic_error("solve_rows: several ranks share the solver; take one of one process");
  const double start = base::now_seconds();
  SolveRowsResult result;
  Status status = solver::guarded(s, [&] {
    s.expect_usable();
    check(b, rows, x.size(), s.current().n());
    if constexpr (!std::is_same_v<Value, double>) {
      const solver::Turned how = solver::turned(s.current(), transpose);
      if (how.conjugate) {
        std::vector<Value> values(b.values.begin(), b.values.end());
        for (Value& v : values) v = std::conj(v);
        solve_paths<Value>(s, {b.col_ptr, b.row_ind, values}, rows, x, how.transpose, result);
        for (Value& v : x) v = std::conj(v);
      } else {
        solve_paths(s, b, rows, x, how.transpose, result);
      }
    } else {
      solve_paths(s, b, rows, x, transpose != Transpose::no, result);
    }
  });
  if (!status.ok()) result.status = std::move(status);
  result.seconds = base::now_seconds() - start;
  return result;
}

}  // namespace

SolveRowsResult solve_rows(Solver& solver, const SparseColumns& b, std::span<const Index> rows, std::span<double> x,
                           Transpose transpose) {
  return solved(solver, b, rows, x, transpose);
}
SolveRowsResult solve_rows(ComplexSolver& solver, const ComplexSparseColumns& b, std::span<const Index> rows,
                           std::span<std::complex<double>> x, Transpose transpose) {
  return solved(solver, b, rows, x, transpose);
}

}  // namespace espalier

#include "modes/pencil.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/stopwatch.hpp"
#include "matrix/transform.hpp"
#include "matrix/validate.hpp"

namespace espalier::modes {

namespace {

constexpr double kAsymmetry = 1e-12;

// What value(row, column, a, b) makes of two matrices with rising rows, on the union of their patterns (zero where one
// has no entry), as lower triangle. @param lower  entries above the diagonal are looked at, and left out
// @param pool  null: by one thread
template <class Value>
SparseMatrix merged(const SparseMatrix& a, const SparseMatrix& b, bool lower, const Value& value,
                    base::ThreadPool* pool) {
  constexpr std::int64_t kColumns = 1024;
  // use(row, value) for the entries of a column.
  const auto each = [&](Index j, auto use) {
    auto p = static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(j)]);
    auto q = static_cast<std::size_t>(b.col_ptr[static_cast<std::size_t>(j)]);
    const auto p_end = static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(j) + 1]);
    const auto q_end = static_cast<std::size_t>(b.col_ptr[static_cast<std::size_t>(j) + 1]);
    while (p < p_end || q < q_end) {
      const Index none = std::numeric_limits<Index>::max();
      const Index i = p < p_end ? a.row_ind[p] : none, k = q < q_end ? b.row_ind[q] : none;
      const Index row = std::min(i, k);
      const double v = value(row, j, i == row ? a.values[p] : 0.0, k == row ? b.values[q] : 0.0);
      p += i == row ? 1U : 0U;
      q += k == row ? 1U : 0U;
      if (!lower || row >= j) use(row, v);
    }
  };
  const auto for_columns = [&](const auto& use) {
    const auto range = [&](std::int64_t begin, std::int64_t end) {
      for (auto j = begin; j < end; ++j) use(static_cast<Index>(j));
    };
    if (pool != nullptr)
      pool->for_each_range(a.cols, kColumns, range);
    else
      range(0, a.cols);
  };
  SparseMatrix out;
  out.rows = out.cols = a.rows;
  out.storage = Storage::symmetric_lower;
  out.col_ptr.assign(static_cast<std::size_t>(a.cols) + 1, 0);
  for_columns([&](Index j) { each(j, [&](Index, double) { ++out.col_ptr[static_cast<std::size_t>(j) + 1]; }); });
  for (std::size_t j = 1; j < out.col_ptr.size(); ++j) out.col_ptr[j] += out.col_ptr[j - 1];
  out.row_ind.resize(static_cast<std::size_t>(out.col_ptr.back()));
  out.values.resize(out.row_ind.size());
  for_columns([&](Index j) {
    each(j, [&, at = static_cast<std::size_t>(out.col_ptr[static_cast<std::size_t>(j)])](Index row, double v) mutable {
      out.row_ind[at] = row;
      out.values[at++] = v;
    });
  });
  return out;
}

SparseMatrix mean_of_triangles(MatrixView a, const std::string& name, base::ThreadPool& pool) {
  a.storage = Storage::symmetric_both;  // read as such rows are put in order and duplicates summed
  const SparseMatrix full = matrix::to_general(a, &pool);
  double largest = 0;
  for (const double v : full.values) largest = std::max(largest, std::abs(v));
  return merged(
      full, matrix::transpose(full), true,
      [&](Index i, Index j, double x, double y) {
        if (std::abs(x - y) > kAsymmetry * largest)
          throw Error(StatusCode::invalid_input,
                      fmt::format("{} is not symmetric: entry ({}, {}) is {:.17g}, entry ({}, {}) is {:.17g}", name, i,
                                  j, x, j, i, y),
                      i);
        return (x + y) / 2;
      },
      nullptr);
}

// A square matrix of numbers, of at least one row.
void check_matrix(const MatrixView& a, const std::string& name, base::ThreadPool& pool) {
  if (a.rows != a.cols)
    throw Error(StatusCode::invalid_input, fmt::format("{} is {} x {}; it must be square", name, a.rows, a.cols));
  if (a.rows == 0) throw Error(StatusCode::invalid_input, fmt::format("{} is empty (0 x 0)", name));
  if (a.values.empty() && a.nonzeros() > 0)
    throw Error(StatusCode::invalid_input, fmt::format("{} has no values, only a pattern", name));
  try {
    matrix::validate(a, &pool);
  } catch (const Error& e) {
    throw Error(e.status().code, fmt::format("{}: {}", name, e.what()), e.status().row);
  }
}

}  // namespace

SparseMatrix symmetric_lower(const MatrixView& a, const std::string& name, base::ThreadPool& pool) {
  check_matrix(a, name, pool);
  if (a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper) return matrix::to_lower(a, &pool);
  return mean_of_triangles(a, name, pool);
}

SparseMatrix general_of(const MatrixView& a, const std::string& name, base::ThreadPool& pool) {
  check_matrix(a, name, pool);
  MatrixView summed = a;
  if (a.storage == Storage::general) summed.storage = Storage::symmetric_both;  // rows in order, duplicates summed
  return matrix::to_general(summed, &pool);
}

SparseMatrix sum(double alpha, const SparseMatrix& a, double beta, const SparseMatrix& b, base::ThreadPool* pool) {
  return merged(
      a, b, false, [&](Index, Index, double x, double y) { return alpha * x + beta * y; }, pool);
}

std::vector<double> diagonal_of(const SparseMatrix& lower) {
  std::vector<double> d(static_cast<std::size_t>(lower.rows), 0.0);
  for (std::size_t j = 0; j < d.size(); ++j) {
    const auto p = static_cast<std::size_t>(lower.col_ptr[j]);
    if (lower.col_ptr[j] < lower.col_ptr[j + 1] && lower.row_ind[p] == static_cast<Index>(j)) d[j] = lower.values[p];
  }
  return d;
}

Options factor_options(const Options& from, Kind kind) {
  Options o = from;
  o.kind = kind;
  o.precision = Precision::fp64;
  o.singular = SingularMatrix::error;
  o.refinement_steps = 0;
  o.required_backward_error = std::numeric_limits<double>::infinity();
  o.permutation.clear();
  o.record_timeline = false;
  return o;
}

Pencil::Pencil(SparseMatrix k, SparseMatrix m, const ModesOptions& options, base::ThreadPool& pool)
    : k_(std::move(k)),
      m_(std::move(m)),
      options_(options.solver),
      pool_(pool),
      solver_(factor_options(options.solver, Kind::ldlt)) {}

void Pencil::lay_out() {
  const base::Stopwatch watch(analysis_seconds);
  pattern_ = sum(1, k_, 0, m_, &pool_);
  k_values_ = pattern_.values;
  m_values_ = sum(0, k_, 1, m_, &pool_).values;
}

void Pencil::prepare(double shift) {
  if (pattern_.rows == 0) lay_out();
  shift_ = shift;
  std::vector<double>& values = pattern_.values;
  pool_.for_each_range(static_cast<std::int64_t>(values.size()), 1 << 15, [&](std::int64_t begin, std::int64_t end) {
    for (auto p = static_cast<std::size_t>(begin); p < static_cast<std::size_t>(end); ++p)
      values[p] = k_values_[p] - shift * m_values_[p];
  });
  // Matching and scaling look at the values of the first shift; the kind is chosen by them.
  if (solver_.state() != Solver::State::empty) return;
  analysis_ = solver_.analyze(pattern_);
  analysis_seconds += analysis_.seconds;
}

Shifted Pencil::factorize(double shift) {
  prepare(shift);
  if (analysis_.status.code == StatusCode::singular) {
    ++factorizations;
    return {analysis_.status, 0, false};
  }
  if (!analysis_.status.ok()) throw Error(analysis_.status);
  FactorResult r = solver_.refactorize(pattern_.values);
  if (r.status.code == StatusCode::invalid_input) {  // so far from the first shift that its scaling does not serve
    analysis_ = solver_.analyze(pattern_);
    analysis_seconds += analysis_.seconds;
    if (!analysis_.status.ok()) throw Error(analysis_.status);
    r = solver_.refactorize(pattern_.values);
  }
  ++factorizations;
  factor_seconds += r.seconds;
  factor_peak_bytes = std::max(factor_peak_bytes, r.peak_host_bytes);
  device_bytes = r.devices.empty() ? 0 : r.devices.front().peak_bytes;
  if (r.status.code == StatusCode::singular) return {r.status, 0, false};
  if (!r.status.ok()) throw Error(r.status);
  if (options_.log)
    options_.log(
        fmt::format("modes: shift {:.6g}: {} negative pivots, {:.2f} s", shift, r.inertia.negative, r.seconds));
  // Pivots that were replaced: their solutions want refinement.
  if (r.perturbed > 0)
    solver_.set_refinement(3, std::numeric_limits<double>::infinity());
  else
    solver_.set_refinement(0, std::numeric_limits<double>::infinity());
  return {{}, r.inertia.negative, r.perturbed == 0};
}

void Pencil::solve(const double* b, double* x, Index columns) {
  const auto size = static_cast<std::size_t>(n()) * static_cast<std::size_t>(columns);
  const SolveResult r = solver_.solve({b, size}, {x, size}, columns);
  if (!r.status.ok()) throw Error(r.status);
}

void Pencil::solve_device(const double* b, double* x, Index columns, void* queue) {
  const SolveResult r = solver_.solve_device(b, x, columns, Transpose::no, queue);
  if (!r.status.ok()) throw Error(r.status);
}

}  // namespace espalier::modes

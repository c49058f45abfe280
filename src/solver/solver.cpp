#include "espalier/solver.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "matrix/validate.hpp"
#include "solver/on_all_ranks.hpp"
#include "solver/session.hpp"
#include "solver/session_calls.hpp"
#include "solver/solution.hpp"
#include "solver/solver_impl.hpp"
#include "solver/status_of.hpp"

namespace espalier {

using solver::analysis_by;
using solver::check_factorized;
using solver::check_values;
using solver::copy_of;
using solver::factor_by;
using solver::guarded;
using solver::Session;
using solver::solve_by;

namespace {

RowRange rows_of(const Session& s) {
  if (!s.parts) return {0, s.current().n()};
  return s.rows ? *s.rows : s.gathered.rows();
}

}  // namespace

Solver::Solver(Options options) : impl_(std::make_unique<Impl>(std::move(options))) {}
Solver::Solver(const Ranks& ranks, Options options) : impl_(std::make_unique<Impl>(ranks, std::move(options))) {}
Solver::Solver(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Solver::~Solver() = default;
Solver::Solver(Solver&&) noexcept = default;
Solver& Solver::operator=(Solver&&) noexcept = default;

Solver Solver::clone(int threads) const {
  solver::check_threads("Solver::clone", threads);
  return Solver(std::make_unique<Impl>(*impl_, threads));
}

AnalysisResult Solver::analyze(const MatrixView& a) {
  return analysis_by(*impl_, [&] { impl_->analyze_given(a); });
}

AnalysisResult Solver::analyze(const LocalRows& part) {
  return analysis_by(*impl_, [&] { impl_->analyze_part(part); });
}

AnalysisResult Solver::analyze(const LocalEntries& part) {
  return analysis_by(*impl_, [&] { impl_->analyze_part(part); });
}

void Solver::set_rows(RowRange rows) {
  solver::check_analyzed(*impl_, "Solver::set_rows");
  const Index n = impl_->current().n();
  if (rows.first < 0 || rows.count < 0 || rows.first > n || rows.count > n - rows.first)
    throw std::invalid_argument(
        fmt::format("Solver::set_rows: {} rows from row {} on of a matrix of {}", rows.count, rows.first, n));
  if (!impl_->parts) throw std::logic_error("Solver::set_rows: the matrix was not given in parts");
  impl_->rows = rows;
}

RowRange Solver::rows() const {
  solver::check_analyzed(*impl_, "Solver::rows");
  return rows_of(*impl_);
}

ChangeResult Solver::analyze_change(const MatrixView& a) {
  solver::check_analyzed(*impl_, "Solver::analyze_change");
  ChangeResult result;
  AnalysisResult analysis = analysis_by(*impl_, [&] {
    if (!impl_->parts || impl_->link() != nullptr) return void(result = impl_->analyze_change_given(a));
    impl_->analyze_given(a);
    result.full = true;
    result.why = "the matrix comes in parts";
  });
  result.analysis = std::move(analysis);
  return result;
}

FactorResult Solver::factorize(const MatrixView& a) {
  solver::check_analyzed(*impl_, "Solver::factorize");
  if (impl_->link() != nullptr) return factorize_on_ranks(a);
  Status status = guarded(*impl_, [&] {
    matrix::validate(a, &impl_->pool);
    solver::expect_same_system(*impl_, a, a.values.size());
  });
  if (!status.ok()) {
    FactorResult r;
    r.status = std::move(status);
    return r;
  }
  return refactorize(a.values);
}

// The matrix of rank 0, which alone looks at it.
FactorResult Solver::factorize_on_ranks(const MatrixView& a) {
  return factor_by(*impl_, [&](solver::Factor& factor) {
    ranks::Link& link = *impl_->link();
    std::span<const double> mine;
    link.expect_all([&] {
      if (link.rank() != 0) return;
      matrix::validate(a, &impl_->pool);
      solver::expect_same_system(*impl_, a, a.values.size());
      mine = a.values;
    });
    factor.factorize({mine, 0, [&] { return std::move(link.all_gather_of(mine).front()); }});
  });
}

FactorResult Solver::refactorize(std::span<const double> values) {
  check_values(*impl_, "Solver::refactorize", static_cast<Offset>(values.size()));
  return factor_by(*impl_, [&](solver::Factor& factor) {
    if (!impl_->parts) return factor.factorize(values);
    const solver::GatheredMatrix::Slice own = impl_->gathered.own_slice(values, impl_->link());
    factor.factorize({own.values, own.first, [&] { return impl_->gathered.gather_values(values, impl_->link()); }});
  });
}

FactorResult Solver::refactorize_device(const double* values, Offset count, void* stream) {
  impl_->expect_whole("refactorize_device");
  check_values(*impl_, "Solver::refactorize_device", count);
  if (values == nullptr) throw std::invalid_argument("Solver::refactorize_device: the values are null");
  return factor_by(*impl_, [&](solver::Factor& factor) { factor.factorize_device(values, count, stream); });
}

int Solver::gpu() const { return impl_->factor ? impl_->factor->gpu() : -1; }

SolveResult Solver::solve_device(const double* b, double* x, Index columns, Transpose transpose, void* stream) {
  check_factorized(*impl_, "Solver::solve_device");
  impl_->expect_whole("solve_device");
  if (columns < 1 || b == nullptr || x == nullptr)
    throw std::invalid_argument("Solver::solve_device: at least one right-hand side and two arrays are needed");
  const solver::SolveJob job{b, x, columns, transpose != Transpose::no};
  return solve_by(*impl_, [&] { return solver::solve_device(*impl_->factor, job, stream, impl_->context); });
}

SolveResult Solver::solve(std::span<const double> b, std::span<double> x, Index columns, Transpose transpose) {
  check_factorized(*impl_, "Solver::solve");
  if (impl_->parts) return solve_in_parts(b, x, columns, transpose);
  const Index n = impl_->current().n();
  const auto size = static_cast<std::size_t>(n) * static_cast<std::size_t>(std::max<Index>(columns, 0));
  if (columns < 1 || b.size() != size || x.size() != size)
    throw std::invalid_argument(
        fmt::format("Solver::solve: {} right-hand sides of {} rows need {} values; b has {}, x has {}", columns, n,
                    size, b.size(), x.size()));
  const solver::SolveJob job{b.data(), x.data(), columns, transpose != Transpose::no};
  return solve_by(*impl_, [&] { return solver::solve(*impl_->factor, job, impl_->context); });
}

// Every rank solves the whole system with the others, and keeps its rows.
SolveResult Solver::solve_in_parts(std::span<const double> b, std::span<double> x, Index columns, Transpose transpose) {
  return solve_by(*impl_, [&] {
    const RowRange rows = rows_of(*impl_);
    if (columns < 1) throw Error(StatusCode::invalid_input, "at least one right-hand side is needed");
    const auto need = static_cast<std::size_t>(rows.count) * static_cast<std::size_t>(columns);
    if (b.size() < need || x.size() < need)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{} right-hand sides of {} rows need {} values on this rank; b has {}, x has {}", columns,
                              rows.count, need, b.size(), x.size()));
    std::vector<double> whole = impl_->gathered.gather_rows(b.first(need), rows, columns, impl_->link());
    const solver::SolveJob job{whole.data(), whole.data(), columns, transpose != Transpose::no};
    SolveResult result = solver::solve(*impl_->factor, job, impl_->context);
    const auto n = static_cast<std::size_t>(impl_->current().n());
    for (std::size_t c = 0; c < static_cast<std::size_t>(columns); ++c)
      std::copy_n(whole.data() + c * n + rows.first, rows.count, x.data() + c * static_cast<std::size_t>(rows.count));
    return result;
  });
}

void Solver::set_refinement(int steps, double required_backward_error) {
  solver::set_refinement(*impl_, steps, required_backward_error);
}

bool Solver::has_pattern(const MatrixView& a) const {
  solver::check_analyzed(*impl_, "Solver::has_pattern");
  return solver::same_pattern(impl_->current().system->prepared, a, impl_->pool);
}

std::vector<double> Solver::values() const {
  check_factorized(*impl_, "Solver::values");
  return impl_->factor->values_by_caller();
}

Solver::State Solver::state() const { return impl_->state(); }
const Options& Solver::options() const { return impl_->options; }
const AnalysisResult& Solver::analysis() const { return impl_->analysis; }

ConditionResult Solver::condition_estimate() { return solver::condition_of(*impl_, "Solver::condition_estimate"); }

std::vector<Solver::TierRow> Solver::tiers() const { return solver::tiers_of(*impl_); }

Status Solver::save_analysis(const std::string& path) const {
  return solver::save_analysis(*impl_, "Solver::save_analysis", path);
}

AnalysisResult Solver::load_analysis(const std::string& path, const MatrixView& a) {
  return analysis_by(*impl_, [&] { impl_->load_given(path, a); });
}

Status Solver::write_trace(const std::string& path) const {
  return solver::write_trace(*impl_, "Solver::write_trace", path);
}

}  // namespace espalier

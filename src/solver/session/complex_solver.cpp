#include "espalier/complex_solver.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "matrix/validate.hpp"
#include "solver/ranks/part_calls.hpp"
#include "solver/session/complex_results.hpp"
#include "solver/session/session_calls.hpp"
#include "solver/session/solver_impl.hpp"
#include "solver/solution/solution.hpp"

namespace espalier {

using solver::complex_result;
using solver::numbers_of;
using solver::Session;

namespace {

using Value = ComplexSolver::Value;

std::span<const double> parts_of(std::span<const Value> values) {
  return {reinterpret_cast<const double*>(values.data()), 2 * values.size()};
}

// op(A) X = B for vectors of the whole system; x may be b.
SolveResult solve_whole(Session& s, const double* b, double* x, Index columns, Transpose transpose) {
  const solver::Turned how = solver::turned(s.current(), transpose);
  const auto count = static_cast<Offset>(s.current().n()) * columns;
  std::vector<double> copy;
  solver::SolveJob job{b, x, columns, how.transpose};
  if (how.conjugate) {
    copy.assign(b, b + 2 * count);
    solver::conjugate(copy.data(), count);
    job.b = copy.data();
  }
  SolveResult result = solver::solve(*s.factor, job, s.context);
  if (how.conjugate) solver::conjugate(job.x, count);
  return result;
}

}  // namespace

ComplexSolver::ComplexSolver(Options options) : impl_(std::make_unique<Impl>(std::move(options))) {}
ComplexSolver::ComplexSolver(const Ranks& ranks, Options options)
    : impl_(std::make_unique<Impl>(ranks, std::move(options))) {}
ComplexSolver::ComplexSolver(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ComplexSolver::~ComplexSolver() = default;
ComplexSolver::ComplexSolver(ComplexSolver&&) noexcept = default;
ComplexSolver& ComplexSolver::operator=(ComplexSolver&&) noexcept = default;

ComplexSolver ComplexSolver::clone(int threads) const {
  solver::check_threads("ComplexSolver::clone", threads);
  return ComplexSolver(std::make_unique<Impl>(*impl_, threads));
}

AnalysisResult ComplexSolver::analyze(const ComplexMatrixView& a) {
  return solver::analysis_by(*impl_, [&] { impl_->analyze_given(solver::given(a)); });
}

AnalysisResult ComplexSolver::analyze(const ComplexLocalRows& part) {
  return solver::analysis_by(*impl_, [&] { impl_->analyze_part(solver::given(part)); });
}

AnalysisResult ComplexSolver::analyze(const ComplexLocalEntries& part) {
  return solver::analysis_by(*impl_, [&] { impl_->analyze_part(solver::given(part)); });
}

ChangeResult ComplexSolver::analyze_change(const ComplexMatrixView& a) {
  return solver::analyze_change(*impl_, "ComplexSolver::analyze_change", solver::given(a));
}

void ComplexSolver::set_rows(RowRange rows) { solver::set_rows(*impl_, "ComplexSolver::set_rows", rows); }

RowRange ComplexSolver::rows() const {
  solver::check_analyzed(*impl_, "ComplexSolver::rows");
  return solver::rows_of(*impl_);
}

ComplexFactorResult ComplexSolver::factorize(const ComplexMatrixView& a) {
  solver::check_analyzed(*impl_, "ComplexSolver::factorize");
  const auto checked = [&] {
    matrix::validate(a, &impl_->pool);
    solver::expect_same_system(*impl_, matrix::pattern_of(a), a.values.size());
    return parts_of(a.values);
  };
  FactorResult r;
  if (impl_->link() != nullptr) {
    r = solver::factorize_of_first(*impl_, checked);
  } else if (r.status = solver::guarded(*impl_, checked); r.status.ok()) {
    r = solver::refactorize_by(*impl_, parts_of(a.values));
  }
  return complex_result(std::move(r), *impl_->factor);
}

ComplexFactorResult ComplexSolver::refactorize(std::span<const Value> values) {
  solver::check_values(*impl_, "ComplexSolver::refactorize", static_cast<Offset>(values.size()));
  FactorResult r = impl_->parts ? solver::refactorize_part(*impl_, parts_of(values))
                                : solver::refactorize_by(*impl_, parts_of(values));
  return complex_result(std::move(r), *impl_->factor);
}

ComplexFactorResult ComplexSolver::refactorize_entries(std::span<const Offset> places, std::span<const Value> values) {
  FactorResult r = solver::refactorize_entries(*impl_, "ComplexSolver::refactorize_entries", places, parts_of(values));
  return complex_result(std::move(r), *impl_->factor);
}

SolveResult ComplexSolver::solve(std::span<const Value> b, std::span<Value> x, Index columns, Transpose transpose) {
  solver::check_factorized(*impl_, "ComplexSolver::solve");
  auto* to = reinterpret_cast<double*>(x.data());
  if (impl_->parts)
    return solver::solve_part(*impl_, parts_of(b), {to, 2 * x.size()}, columns,
                              [&](double* all) { return solve_whole(*impl_, all, all, columns, transpose); });
  const Index n = impl_->current().n();
  const auto size = at(n) * static_cast<std::size_t>(std::max<Index>(columns, 0));
  if (columns < 1 || b.size() != size || x.size() != size)
    throw std::invalid_argument(
        fmt::format("ComplexSolver::solve: {} right-hand sides of {} rows need {} values; b has {}, x has {}", columns,
                    n, size, b.size(), x.size()));
  return solver::solve_by(*impl_, [&] { return solve_whole(*impl_, parts_of(b).data(), to, columns, transpose); });
}

void ComplexSolver::set_refinement(int steps, double required_backward_error) {
  solver::set_refinement(*impl_, steps, required_backward_error);
}

bool ComplexSolver::has_pattern(const ComplexMatrixView& a) const {
  solver::check_analyzed(*impl_, "ComplexSolver::has_pattern");
  return solver::same_pattern(impl_->current().system->prepared, matrix::pattern_of(a), impl_->pool);
}

std::vector<Value> ComplexSolver::values() const {
  solver::check_factorized(*impl_, "ComplexSolver::values");
  return numbers_of(impl_->factor->values_by_caller());
}

ComplexSolver::State ComplexSolver::state() const { return impl_->state(); }
const Options& ComplexSolver::options() const { return impl_->options; }
const AnalysisResult& ComplexSolver::analysis() const { return impl_->analysis; }

ConditionResult ComplexSolver::condition_estimate() {
  return solver::condition_of(*impl_, "ComplexSolver::condition_estimate");
}

std::vector<Solver::TierRow> ComplexSolver::tiers() const { return solver::tiers_of(*impl_); }

Status ComplexSolver::save_analysis(const std::string& path) const {
  return solver::save_analysis(*impl_, "ComplexSolver::save_analysis", path);
}

AnalysisResult ComplexSolver::load_analysis(const std::string& path, const ComplexMatrixView& a) {
  return solver::analysis_by(*impl_, [&] { impl_->load_given(path, solver::given(a)); });
}

AnalysisResult ComplexSolver::load_analysis(const std::string& path, const ComplexLocalRows& part) {
  return solver::analysis_by(*impl_, [&] { impl_->load_part(path, solver::given(part)); });
}

AnalysisResult ComplexSolver::load_analysis(const std::string& path, const ComplexLocalEntries& part) {
  return solver::analysis_by(*impl_, [&] { impl_->load_part(path, solver::given(part)); });
}

Status ComplexSolver::write_trace(const std::string& path) const {
  return solver::write_trace(*impl_, "ComplexSolver::write_trace", path);
}

}  // namespace espalier

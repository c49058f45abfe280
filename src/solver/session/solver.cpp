#include "espalier/solver.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "matrix/validate.hpp"
#include "solver/ranks/part_calls.hpp"
#include "solver/session/session_calls.hpp"
#include "solver/session/solver_impl.hpp"
#include "solver/session/status_of.hpp"
#include "solver/solution/solution.hpp"

namespace espalier {

using solver::analysis_by;
using solver::check_factorized;
using solver::check_values;
using solver::copy_of;
using solver::factor_by;
using solver::GivenLocal;
using solver::guarded;
using solver::solve_by;

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
  return analysis_by(*impl_, [&] { impl_->analyze_part(GivenLocal<LocalRows>(part)); });
}

AnalysisResult Solver::analyze(const LocalEntries& part) {
  return analysis_by(*impl_, [&] { impl_->analyze_part(GivenLocal<LocalEntries>(part)); });
}

void Solver::set_rows(RowRange rows) { solver::set_rows(*impl_, "Solver::set_rows", rows); }

RowRange Solver::rows() const {
  solver::check_analyzed(*impl_, "Solver::rows");
  return solver::rows_of(*impl_);
}

ChangeResult Solver::analyze_change(const MatrixView& a) {
  return solver::analyze_change(*impl_, "Solver::analyze_change", a);
}

FactorResult Solver::factorize(const MatrixView& a) {
  solver::check_analyzed(*impl_, "Solver::factorize");
  const auto checked = [&] {
    matrix::validate(a, &impl_->pool);
    solver::expect_same_system(*impl_, a, a.values.size());
    return a.values;
  };
  if (impl_->link() != nullptr) return solver::factorize_of_first(*impl_, checked);
  Status status = guarded(*impl_, checked);
  if (status.ok()) return solver::refactorize_by(*impl_, a.values);
  FactorResult r;
  r.status = std::move(status);
  return r;
}

FactorResult Solver::refactorize(std::span<const double> values) {
  check_values(*impl_, "Solver::refactorize", static_cast<Offset>(values.size()));
  if (impl_->parts) return solver::refactorize_part(*impl_, values);
  return solver::refactorize_by(*impl_, values);
}

FactorResult Solver::refactorize_entries(std::span<const Offset> places, std::span<const double> values) {
  return solver::refactorize_entries(*impl_, "Solver::refactorize_entries", places, values);
}

FactorResult Solver::refactorize_device(const double* values, Offset count, void* stream) {
  if (impl_->factor && impl_->parts) return solver::refactorize_part_device(*impl_, values, count, stream);
  check_values(*impl_, "Solver::refactorize_device", count);
  if (values == nullptr) throw std::invalid_argument("Solver::refactorize_device: the values are null");
  return factor_by(*impl_, [&](solver::Factor& factor) { factor.factorize_device(values, count, stream); });
}

int Solver::gpu() const { return impl_->factor ? impl_->factor->gpu() : -1; }

GpuPlaces Solver::gpu_places() const { return impl_->factor ? impl_->factor->gpu_places() : GpuPlaces{}; }

SolveResult Solver::solve_device(const double* b, double* x, Index columns, Transpose transpose, void* stream) {
  check_factorized(*impl_, "Solver::solve_device");
  if (impl_->parts)
    return solver::solve_part_device(*impl_, b, x, columns, stream, [&](double* all) {
      return solver::solve(*impl_->factor, {all, all, columns, transpose != Transpose::no}, impl_->context);
    });
  if (columns < 1 || b == nullptr || x == nullptr)
    throw std::invalid_argument("Solver::solve_device: at least one right-hand side and two arrays are needed");
  const solver::SolveJob job{b, x, columns, transpose != Transpose::no};
  return solve_by(*impl_, [&] { return solver::solve_device(*impl_->factor, job, stream, impl_->context); });
}

SolveResult Solver::solve(std::span<const double> b, std::span<double> x, Index columns, Transpose transpose) {
  check_factorized(*impl_, "Solver::solve");
  if (impl_->parts)
    return solver::solve_part(*impl_, b, x, columns, [&](double* all) {
      return solver::solve(*impl_->factor, {all, all, columns, transpose != Transpose::no}, impl_->context);
    });
  const Index n = impl_->current().n();
  const auto size = at(n) * static_cast<std::size_t>(std::max<Index>(columns, 0));
  if (columns < 1 || b.size() != size || x.size() != size)
    throw std::invalid_argument(
        fmt::format("Solver::solve: {} right-hand sides of {} rows need {} values; b has {}, x has {}", columns, n,
                    size, b.size(), x.size()));
  const solver::SolveJob job{b.data(), x.data(), columns, transpose != Transpose::no};
  return solve_by(*impl_, [&] { return solver::solve(*impl_->factor, job, impl_->context); });
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

AnalysisResult Solver::load_analysis(const std::string& path, const LocalRows& part) {
  return analysis_by(*impl_, [&] { impl_->load_part(path, GivenLocal<LocalRows>(part)); });
}

AnalysisResult Solver::load_analysis(const std::string& path, const LocalEntries& part) {
  return analysis_by(*impl_, [&] { impl_->load_part(path, GivenLocal<LocalEntries>(part)); });
}

Status Solver::write_trace(const std::string& path) const {
  return solver::write_trace(*impl_, "Solver::write_trace", path);
}

}  // namespace espalier

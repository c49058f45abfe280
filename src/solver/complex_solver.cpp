#include "espalier/complex_solver.hpp"

#include <fmt/format.h>

#include <utility>

#include "matrix/validate.hpp"
#include "solver/analysis_file.hpp"
#include "solver/option_check.hpp"
#include "solver/session_calls.hpp"
#include "solver/solution.hpp"

namespace espalier {

using solver::Session;

struct ComplexSolver::Impl : Session {
  using Session::Session;
};

namespace {

using Value = ComplexSolver::Value;

std::span<const double> parts_of(std::span<const Value> values) {
  return {reinterpret_cast<const double*>(values.data()), 2 * values.size()};
}

std::vector<Value> numbers_of(const std::vector<double>& parts) {
  const Value* first = base::as_complex(parts.data());
  return {first, first + parts.size() / 2};
}

ComplexFactorResult complex_result(FactorResult from, Value phase) {
  ComplexFactorResult r;
  const std::vector<double> null = std::move(from.null_vectors), left = std::move(from.left_null_vectors);
  static_cast<FactorReport&>(r) = std::move(from);
  r.determinant_phase = phase;
  r.null_vectors = numbers_of(null);
  r.left_null_vectors = numbers_of(left);
  return r;
}

// A^T of a Hermitian matrix is its conjugate, as is A^H of a symmetric one; A^H x = b of a general one is A^T with the
// conjugates of both. How a system is solved with A or A^T alone:
struct Turned {
  bool transpose = false;  ///< with A^T (lu)
  bool conjugate = false;  ///< for the conjugates of x and b
};
Turned turned(const solver::Analysis& a, Transpose wish) {
  if (wish == Transpose::no) return {};
  if (a.kind() == Kind::lu) return {true, wish == Transpose::conjugate};
  const bool hermitian = a.system->numbers() == base::Numbers::hermitian;
  return {false, (wish == Transpose::yes) == hermitian};
}

}  // namespace

ComplexSolver::ComplexSolver(Options options) : impl_(std::make_unique<Impl>(std::move(options))) {}
ComplexSolver::ComplexSolver(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ComplexSolver::~ComplexSolver() = default;
ComplexSolver::ComplexSolver(ComplexSolver&&) noexcept = default;
ComplexSolver& ComplexSolver::operator=(ComplexSolver&&) noexcept = default;

ComplexSolver ComplexSolver::clone(int threads) const {
  if (threads < 0 || threads > solver::kMostThreads)
    throw std::invalid_argument(fmt::format("ComplexSolver::clone: {} threads; give 0 (as many as this solver) to {}",
                                            threads, solver::kMostThreads));
  return ComplexSolver(std::make_unique<Impl>(*impl_, threads));
}

AnalysisResult ComplexSolver::analyze(const ComplexMatrixView& a) {
  return solver::analysis_by(*impl_, [&] {
    matrix::validate(a, &impl_->pool);
    impl_->analyze(solver::given(a));
  });
}

ComplexFactorResult ComplexSolver::factorize(const ComplexMatrixView& a) {
  if (!impl_->factor) throw std::logic_error("ComplexSolver::factorize: call analyze() first");
  Status status = solver::guarded(*impl_, [&] {
    matrix::validate(a, &impl_->pool);
    if (!solver::same_pattern(impl_->current().system->prepared, matrix::pattern_of(a), impl_->pool))
      throw Error(StatusCode::invalid_input,
                  "the matrix has another pattern than the one analyzed; call analyze() again");
    if (a.values.empty() && a.nonzeros() > 0)
      throw Error(StatusCode::invalid_input, "the matrix has no values; a pattern cannot be factorized");
  });
  if (!status.ok()) {
    ComplexFactorResult r;
    r.status = std::move(status);
    return r;
  }
  return refactorize(a.values);
}

ComplexFactorResult ComplexSolver::refactorize(std::span<const Value> values) {
  solver::check_values(*impl_, "ComplexSolver::refactorize", static_cast<Offset>(values.size()));
  FactorResult r = solver::factor_by(*impl_, [&](solver::Factor& factor) { factor.factorize(parts_of(values)); });
  return complex_result(std::move(r), impl_->factor->determinant_phase());
}

SolveResult ComplexSolver::solve(std::span<const Value> b, std::span<Value> x, Index columns, Transpose transpose) {
  solver::check_factorized(*impl_, "ComplexSolver::solve");
  const Index n = impl_->current().n();
  const auto size = static_cast<std::size_t>(n) * static_cast<std::size_t>(std::max<Index>(columns, 0));
  if (columns < 1 || b.size() != size || x.size() != size)
    throw std::invalid_argument(
        fmt::format("ComplexSolver::solve: {} right-hand sides of {} rows need {} values; b has {}, x has {}", columns,
                    n, size, b.size(), x.size()));
  const Turned how = turned(impl_->current(), transpose);
  return solver::solve_by(*impl_, [&] {
    std::vector<double> copy;
    solver::SolveJob job{parts_of(b).data(), reinterpret_cast<double*>(x.data()), columns, how.transpose};
    const auto count = static_cast<Offset>(size);
    if (how.conjugate) {
      copy.assign(job.b, job.b + 2 * size);
      solver::conjugate(copy.data(), count);
      job.b = copy.data();
    }
    SolveResult result = solver::solve(*impl_->factor, job, impl_->context);
    if (how.conjugate) solver::conjugate(job.x, count);
    return result;
  });
}

void ComplexSolver::set_refinement(int steps, double required_backward_error) {
  Options changed = impl_->options;
  changed.refinement_steps = steps;
  changed.required_backward_error = required_backward_error;
  solver::check_options(changed);
  impl_->options.refinement_steps = steps;
  impl_->options.required_backward_error = required_backward_error;
}

bool ComplexSolver::has_pattern(const ComplexMatrixView& a) const {
  if (!impl_->factor) throw std::logic_error("ComplexSolver::has_pattern: there is no analysis");
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
  solver::check_factorized(*impl_, "ComplexSolver::condition_estimate");
  ConditionResult r;
  r.status = solver::guarded(*impl_, [&] {
    impl_->expect_usable();
    r.estimate = solver::estimate_condition(*impl_->factor);
  });
  return r;
}

std::vector<Solver::TierRow> ComplexSolver::tiers() const { return solver::tiers_of(*impl_); }

Status ComplexSolver::save_analysis(const std::string& path) const {
  if (!impl_->factor) throw std::logic_error("ComplexSolver::save_analysis: there is no analysis");
  return solver::guarded(*impl_, [&] {
    const solver::Analysis& a = impl_->current();
    const auto& p = a.system->prepared;
    solver::write_analysis(path, {a.kind(), a.plan.tree, p.row_scale, p.col_scale, p.row_of_col},
                           solver::caller_hash(p, impl_->pool));
  });
}

AnalysisResult ComplexSolver::load_analysis(const std::string& path, const ComplexMatrixView& a) {
  return solver::analysis_by(*impl_, [&] {
    matrix::validate(a, &impl_->pool);
    impl_->load_analysis(path, solver::given(a));
  });
}

Status ComplexSolver::write_trace(const std::string& path) const {
  if (!impl_->timeline) throw std::logic_error("ComplexSolver::write_trace: Options::record_timeline was not set");
  return solver::guarded(*impl_, [&] { impl_->timeline->write(path); });
}

}  // namespace espalier

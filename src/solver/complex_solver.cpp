#include "espalier/complex_solver.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "matrix/validate.hpp"
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

// use(the matrix, or on ranks that of rank 0): valid.
template <class Use>
void with_whole(Session& s, const ComplexMatrixView& a, Use&& use) {
  if (s.link() == nullptr) {
    matrix::validate(a, &s.pool);
    return use(a);
  }
  const SparseMatrix of_first =
      s.gathered.gather({a.rows, a.cols, a.col_ptr, a.row_ind, parts_of(a.values), a.storage}, s.link());
  const std::span<const Value> values(base::as_complex(of_first.values.data()), of_first.values.size() / 2);
  const ComplexMatrixView whole{of_first.rows,    of_first.cols, of_first.col_ptr,
                                of_first.row_ind, values,        of_first.storage};
  matrix::validate(whole, &s.pool);
  use(whole);
}

// On ranks: the numbers of rank 0, on all of them.
std::vector<double> of_first(Session& s, std::span<const Value> mine, std::size_t count, const char* what) {
  const bool here = s.link()->rank() == 0;
  s.link()->expect_all([&] {
    if (here && mine.size() != count)
      throw Error(StatusCode::invalid_input,
                  fmt::format("rank 0 gives {} {}; {} are needed", mine.size(), what, count));
  });
  return s.link()->all_gather_of(here ? parts_of(mine) : std::span<const double>()).front();
}

// op(A) X = B for vectors of the whole system; x may be b.
SolveResult solve_whole(Session& s, const double* b, double* x, Index columns, Transpose transpose) {
  const Turned how = turned(s.current(), transpose);
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
  return solver::analysis_by(*impl_, [&] {
    with_whole(*impl_, a, [&](const ComplexMatrixView& whole) { impl_->analyze(solver::given(whole)); });
  });
}

ComplexFactorResult ComplexSolver::factorize(const ComplexMatrixView& a) {
  solver::check_analyzed(*impl_, "ComplexSolver::factorize");
  if (impl_->link() == nullptr) {
    Status status = solver::guarded(*impl_, [&] {
      matrix::validate(a, &impl_->pool);
      solver::expect_same_system(*impl_, matrix::pattern_of(a), a.values.size());
    });
    if (status.ok()) return refactorize(a.values);
    ComplexFactorResult r;
    r.status = std::move(status);
    return r;
  }
  FactorResult r = solver::factor_by(*impl_, [&](solver::Factor& factor) {
    with_whole(*impl_, a, [&](const ComplexMatrixView& whole) {
      solver::expect_same_system(*impl_, matrix::pattern_of(whole), whole.values.size());
      factor.factorize(parts_of(whole.values));
    });
  });
  return complex_result(std::move(r), impl_->factor->determinant_phase());
}

ComplexFactorResult ComplexSolver::refactorize(std::span<const Value> values) {
  solver::check_analyzed(*impl_, "ComplexSolver::refactorize");
  const bool shared = impl_->link() != nullptr;
  if (!shared) solver::check_values(*impl_, "ComplexSolver::refactorize", static_cast<Offset>(values.size()));
  FactorResult r = solver::factor_by(*impl_, [&](solver::Factor& factor) {
    if (!shared) return factor.factorize(parts_of(values));
    const auto count = static_cast<std::size_t>(impl_->current().system->prepared.caller_nonzeros);
    factor.factorize(of_first(*impl_, values, count, "values"));
  });
  return complex_result(std::move(r), impl_->factor->determinant_phase());
}

SolveResult ComplexSolver::solve(std::span<const Value> b, std::span<Value> x, Index columns, Transpose transpose) {
  solver::check_factorized(*impl_, "ComplexSolver::solve");
  const Index n = impl_->current().n();
  const auto size = static_cast<std::size_t>(n) * static_cast<std::size_t>(std::max<Index>(columns, 0));
  const bool shared = impl_->link() != nullptr;
  if (columns < 1 || (!shared && (b.size() != size || x.size() != size)))
    throw std::invalid_argument(
        fmt::format("ComplexSolver::solve: {} right-hand sides of {} rows need {} values; b has {}, x has {}", columns,
                    n, size, b.size(), x.size()));
  return solver::solve_by(*impl_, [&] {
    if (!shared)
      return solve_whole(*impl_, parts_of(b).data(), reinterpret_cast<double*>(x.data()), columns, transpose);
    std::vector<double> whole = of_first(*impl_, b, size, "numbers of right-hand sides");
    (void)of_first(*impl_, x, size, "places for solutions");
    SolveResult result = solve_whole(*impl_, whole.data(), whole.data(), columns, transpose);
    if (impl_->link()->rank() == 0) std::copy_n(base::as_complex(whole.data()), size, x.begin());
    return result;
  });
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
  return solver::analysis_by(*impl_, [&] {
    with_whole(*impl_, a, [&](const ComplexMatrixView& whole) { impl_->load_analysis(path, solver::given(whole)); });
  });
}

Status ComplexSolver::write_trace(const std::string& path) const {
  return solver::write_trace(*impl_, "ComplexSolver::write_trace", path);
}

}  // namespace espalier

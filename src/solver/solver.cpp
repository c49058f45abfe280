#include "espalier/solver.hpp"

#include <fmt/format.h>

#include <new>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "matrix/validate.hpp"
#include "solver/analysis_file.hpp"
#include "solver/option_check.hpp"
#include "solver/session.hpp"
#include "solver/solution.hpp"

namespace espalier {

namespace {

using solver::Session;

// Runs body() and turns its failure into a value. Meanwhile the caller may interrupt.
template <class Body>
Status guarded(Session& s, Body&& body) {
  try {
    const base::Interruption::Call call(s.interruption);
    body();
    return {};
  } catch (const Error& e) {
    return e.status();
  } catch (const std::bad_alloc&) {
    return {StatusCode::out_of_memory, "the machine refused memory; use a smaller system or a machine with more memory",
            -1};
  } catch (const std::length_error&) {
    return {StatusCode::out_of_memory, "an array longer than the machine can address was needed", -1};
  } catch (const std::system_error& e) {
    if (e.code() != std::errc::resource_unavailable_try_again) throw;
    return {StatusCode::out_of_memory, "the system refuses to start another thread; raise the limit (ulimit -u)", -1};
  }
}

// The caller's copy of a result; without memory for it, a bare status.
template <class Result>
Result copy_of(const Result& result) {
  try {
    return result;
  } catch (const std::bad_alloc&) {
    Result bare;
    bare.status.code = StatusCode::out_of_memory;
    bare.status.message = "out of memory";  // short enough to need none
    return bare;
  }
}

void check_values(const Session& s, const char* call, Offset count) {
  if (!s.factor) throw std::logic_error(fmt::format("Solver::{}: call analyze() first", call));
  const Offset expected = s.current().system->prepared.caller_nonzeros;
  if (count != expected)
    throw std::invalid_argument(
        fmt::format("Solver::{}: {} values for a pattern of {} entries", call, count, expected));
}

void check_factorized(const Session& s, const char* call) {
  if (s.state() != Solver::State::factorized)
    throw std::logic_error(fmt::format("Solver::{}: there is no factorization", call));
}

// What `body` makes of s.factor; a failure takes the numbers with it.
template <class Body>
FactorResult factor_by(Session& s, Body&& body) {
  const int before = s.factor->changes();
  Status status = guarded(s, [&] {
    s.expect_usable();
    if (s.opening.valid()) s.opening.wait();
    s.note_devices();
    body(*s.factor);
  });
  FactorResult& result = s.factor->result();
  if (!status.ok()) {
    result.status = std::move(status);
    if (!s.device_lost()) s.factor->drop();
  }
  if (s.factor->changes() != before) s.analysis = copy_of(s.current().result);
  return copy_of(result);
}

template <class Body>
SolveResult solve_by(Session& s, Body&& body) {
  s.solution = SolveResult{};
  Status status = guarded(s, [&] {
    s.expect_usable();
    s.solution = body();
  });
  if (!status.ok()) s.solution.status = std::move(status);
  return copy_of(s.solution);
}

template <class Body>
AnalysisResult analysis_by(Session& s, Body&& body) {
  s.analysis = AnalysisResult{};
  s.analysis.status = guarded(s, [&] {
    s.expect_usable();
    body();
  });
  if (!s.analysis.status.ok() && !s.device_lost()) s.factor.reset();
  return copy_of(s.analysis);
}

}  // namespace

struct Solver::Impl : solver::Session {
  using Session::Session;
};

Solver::Solver(Options options) : impl_(std::make_unique<Impl>(std::move(options))) {}
Solver::Solver(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Solver::~Solver() = default;
Solver::Solver(Solver&&) noexcept = default;
Solver& Solver::operator=(Solver&&) noexcept = default;

Solver Solver::clone(int threads) const {
  if (threads < 0 || threads > solver::kMostThreads)
    throw std::invalid_argument(
        fmt::format("Solver::clone: {} threads; give 0 (as many as this solver) to {}", threads, solver::kMostThreads));
  return Solver(std::make_unique<Impl>(*impl_, threads));
}

AnalysisResult Solver::analyze(const MatrixView& a) {
  return analysis_by(*impl_, [&] { impl_->analyze(a); });
}

FactorResult Solver::factorize(const MatrixView& a) {
  if (!impl_->factor) throw std::logic_error("Solver::factorize: call analyze() first");
  Status status = guarded(*impl_, [&] {
    matrix::validate(a, &impl_->pool);
    if (!solver::same_pattern(impl_->current().system->prepared, a, impl_->pool))
      throw Error(StatusCode::invalid_input,
                  "the matrix has another pattern than the one analyzed; call analyze() again");
    if (a.values.empty() && a.nonzeros() > 0)
      throw Error(StatusCode::invalid_input, "the matrix has no values; a pattern cannot be factorized");
  });
  if (!status.ok()) {
    FactorResult r;
    r.status = std::move(status);
    return r;
  }
  return refactorize(a.values);
}

FactorResult Solver::refactorize(std::span<const double> values) {
  check_values(*impl_, "refactorize", static_cast<Offset>(values.size()));
  return factor_by(*impl_, [&](solver::Factor& factor) { factor.factorize(values); });
}

FactorResult Solver::refactorize_device(const double* values, Offset count, void* stream) {
  check_values(*impl_, "refactorize_device", count);
  if (values == nullptr) throw std::invalid_argument("Solver::refactorize_device: the values are null");
  return factor_by(*impl_, [&](solver::Factor& factor) { factor.factorize_device(values, count, stream); });
}

int Solver::gpu() const { return impl_->factor ? impl_->factor->gpu() : -1; }

SolveResult Solver::solve_device(const double* b, double* x, Index columns, Transpose transpose, void* stream) {
  check_factorized(*impl_, "solve_device");
  if (columns < 1 || b == nullptr || x == nullptr)
    throw std::invalid_argument("Solver::solve_device: at least one right-hand side and two arrays are needed");
  const solver::SolveJob job{b, x, columns, transpose == Transpose::yes};
  return solve_by(*impl_, [&] { return solver::solve_device(*impl_->factor, job, stream, impl_->context); });
}

SolveResult Solver::solve(std::span<const double> b, std::span<double> x, Index columns, Transpose transpose) {
  check_factorized(*impl_, "solve");
  const Index n = impl_->current().n();
  const auto size = static_cast<std::size_t>(n) * static_cast<std::size_t>(std::max<Index>(columns, 0));
  if (columns < 1 || b.size() != size || x.size() != size)
    throw std::invalid_argument(
        fmt::format("Solver::solve: {} right-hand sides of {} rows need {} values; b has {}, x has {}", columns, n,
                    size, b.size(), x.size()));
  const solver::SolveJob job{b.data(), x.data(), columns, transpose == Transpose::yes};
  return solve_by(*impl_, [&] { return solver::solve(*impl_->factor, job, impl_->context); });
}

void Solver::set_refinement(int steps, double required_backward_error) {
  Options changed = impl_->options;
  changed.refinement_steps = steps;
  changed.required_backward_error = required_backward_error;
  solver::check_options(changed);
  impl_->options.refinement_steps = steps;
  impl_->options.required_backward_error = required_backward_error;
}

bool Solver::has_pattern(const MatrixView& a) const {
  if (!impl_->factor) throw std::logic_error("Solver::has_pattern: there is no analysis");
  return solver::same_pattern(impl_->current().system->prepared, a, impl_->pool);
}

std::vector<double> Solver::values() const {
  check_factorized(*impl_, "values");
  return impl_->factor->values_by_caller();
}

Solver::State Solver::state() const { return impl_->state(); }
const Options& Solver::options() const { return impl_->options; }
const AnalysisResult& Solver::analysis() const { return impl_->analysis; }

ConditionResult Solver::condition_estimate() {
  check_factorized(*impl_, "condition_estimate");
  ConditionResult r;
  r.status = guarded(*impl_, [&] {
    impl_->expect_usable();
    r.estimate = solver::estimate_condition(*impl_->factor);
  });
  return r;
}

std::vector<Solver::TierRow> Solver::tiers() const {
  std::vector<TierRow> rows;
  if (!impl_->factor) return rows;
  const plan::Plan& p = impl_->current().plan;
  rows.resize(static_cast<std::size_t>(impl_->analysis.tiers));
  for (Index f = 0; f < p.fronts(); ++f) {
    if (static_cast<std::size_t>(p.tier[f]) >= rows.size()) rows.resize(static_cast<std::size_t>(p.tier[f]) + 1);
    TierRow& r = rows[static_cast<std::size_t>(p.tier[f])];
    const double k = p.layout[f].pivots;
    const double m = p.layout[f].rows;
    r.tier = p.tier[f];
    ++r.fronts;
    r.largest_front = std::max(r.largest_front, p.layout[f].rows);
    r.flops += plan::front_flops(p.layout[f].pivots, p.layout[f].rows, p.options.unsymmetric);
    r.factor_entries += static_cast<Offset>(k * m - k * (k - 1) / 2) * (p.options.unsymmetric ? 2 : 1);
  }
  return rows;
}

Status Solver::save_analysis(const std::string& path) const {
  if (!impl_->factor) throw std::logic_error("Solver::save_analysis: there is no analysis");
  return guarded(*impl_, [&] {
    const solver::Analysis& a = impl_->current();
    const auto& p = a.system->prepared;
    solver::write_analysis(path, {a.kind(), a.plan.tree, p.row_scale, p.col_scale, p.row_of_col}, p.caller_pattern);
  });
}

AnalysisResult Solver::load_analysis(const std::string& path, const MatrixView& a) {
  return analysis_by(*impl_, [&] { impl_->load_analysis(path, a); });
}

Status Solver::write_trace(const std::string& path) const {
  if (!impl_->timeline) throw std::logic_error("Solver::write_trace: Options::record_timeline was not set");
  return guarded(*impl_, [&] { impl_->timeline->write(path); });
}

}  // namespace espalier

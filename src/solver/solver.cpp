#include "espalier/solver.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <future>
#include <new>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "base/forks.hpp"
#include "matrix/validate.hpp"
#include "solver/analysis_file.hpp"
#include "solver/option_check.hpp"
#include "solver/solver_impl.hpp"

namespace espalier {

namespace {

// Runs body() and turns its failure into a value.
template <class Body>
Status guarded(Body&& body) {
  try {
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

template <class Impl>
void check_values(const Impl& impl, const char* call, Offset count) {
  if (impl.state == Solver::State::empty) throw std::logic_error(fmt::format("Solver::{}: call analyze() first", call));
  if (count != impl.equations.caller_nonzeros)
    throw std::invalid_argument(
        fmt::format("Solver::{}: {} values for a pattern of {} entries", call, count, impl.equations.caller_nonzeros));
}

// What `body` left in impl.factor; a failure takes the factor with it.
template <class Impl, class Body>
FactorResult factor_by(Impl& impl, Body&& body) {
  Status status = guarded([&] {
    impl.expect_usable();
    body();
  });
  if (!status.ok()) {
    impl.factor.status = std::move(status);
    if (!impl.gpu_lost()) impl.numeric.reset();
  }
  return copy_of(impl.factor);
}

// Where the caller says nothing: what the environment says to programs with threads ("4", or "4,2" for nested ones),
// else all cores.
int usual_threads() {
  if (const char* text = std::getenv("OMP_NUM_THREADS")) {
    int threads = 0;
    const auto [end, error] = std::from_chars(text, text + std::strlen(text), threads);
    if (error == std::errc{} && (*end == '\0' || *end == ',') && threads >= 1)
      return std::min(threads, solver::kMostThreads);
  }
  return base::available_cores();
}

int threads_of(const Options& o) {
  solver::check_options(o);
  const int threads = o.threads > 0 ? o.threads : usual_threads();
  const auto host = solver::host_devices(o.device, threads);
  return host ? host->devices * host->threads : threads;
}

}  // namespace

Solver::Impl::Impl(Options the_options)
    : options(std::move(the_options)), pool(threads_of(options)), budget("host memory", options.host_memory_bytes) {
  if (options.record_timeline) timeline = std::make_unique<base::Timeline>();
}

// What belongs to a GPU or to a thread of the parent cannot be ended in the child of a fork(): it is left alone.
Solver::Impl::~Impl() {
  if (!gpu_lost()) return;
  (void)numeric.release();
  (void)new (std::nothrow) std::future<void>(std::move(gpus_open));
}

bool Solver::Impl::gpu_lost() const { return gpu_forks && *gpu_forks != base::forks(); }

void Solver::Impl::expect_usable() const {
  if (gpu_lost())
    throw Error(StatusCode::device_error,
                "this solver has used a GPU before fork(), and CUDA does not follow into the child; make a new solver "
                "there, with device cpu, or start the process afresh (Python: multiprocessing's 'spawn')");
}

Solver::Solver(Options options) : impl_(std::make_unique<Impl>(std::move(options))) {}
Solver::~Solver() = default;
Solver::Solver(Solver&&) noexcept = default;
Solver& Solver::operator=(Solver&&) noexcept = default;

AnalysisResult Solver::analyze(const MatrixView& a) {
  impl_->analysis = AnalysisResult{};
  const Status status = guarded([&] {
    impl_->expect_usable();
    impl_->analyze(a);
  });
  if (!status.ok()) impl_->state = State::empty;
  impl_->analysis.status = status;
  return copy_of(impl_->analysis);
}

FactorResult Solver::factorize(const MatrixView& a) {
  if (impl_->state == State::empty) throw std::logic_error("Solver::factorize: call analyze() first");
  Status status = guarded([&] {
    matrix::validate(a, &impl_->pool);
    if (!solver::same_pattern(impl_->equations, a, impl_->pool))
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
  return factor_by(*impl_, [&] { impl_->factorize(values); });
}

FactorResult Solver::refactorize_device(const double* values, Offset count, void* stream) {
  check_values(*impl_, "refactorize_device", count);
  if (values == nullptr) throw std::invalid_argument("Solver::refactorize_device: the values are null");
  return factor_by(*impl_, [&] { impl_->factorize_device(values, count, stream); });
}

SolveResult Solver::solve_device(const double* b, double* x, Index columns, Transpose transpose, void* stream) {
  if (impl_->state != State::factorized) throw std::logic_error("Solver::solve_device: there is no factorization");
  if (columns < 1 || b == nullptr || x == nullptr)
    throw std::invalid_argument("Solver::solve_device: at least one right-hand side and two arrays are needed");
  const Status status = guarded([&] {
    impl_->expect_usable();
    impl_->solve_device(b, x, columns, transpose == Transpose::yes, stream);
  });
  if (!status.ok()) impl_->solution.status = status;
  return copy_of(impl_->solution);
}

SolveResult Solver::solve(std::span<const double> b, std::span<double> x, Index columns, Transpose transpose) {
  if (impl_->state != State::factorized) throw std::logic_error("Solver::solve: there is no factorization");
  const auto size =
      static_cast<std::size_t>(impl_->plan.tree.n) * static_cast<std::size_t>(std::max<Index>(columns, 0));
  if (columns < 1 || b.size() != size || x.size() != size)
    throw std::invalid_argument(
        fmt::format("Solver::solve: {} right-hand sides of {} rows need {} values; b has {}, x has {}", columns,
                    impl_->plan.tree.n, size, b.size(), x.size()));
  const Status status = guarded([&] {
    impl_->expect_usable();
    impl_->solve(b, x, columns, transpose == Transpose::yes);
  });
  if (!status.ok()) impl_->solution.status = status;
  return copy_of(impl_->solution);
}

Solver::State Solver::state() const { return impl_->state; }
const Options& Solver::options() const { return impl_->options; }
const AnalysisResult& Solver::analysis() const { return impl_->analysis; }

ConditionResult Solver::condition_estimate() {
  if (impl_->state != State::factorized)
    throw std::logic_error("Solver::condition_estimate: there is no factorization");
  ConditionResult r;
  r.status = guarded([&] {
    impl_->expect_usable();
    r.estimate = impl_->condition_estimate();
  });
  return r;
}

std::vector<Solver::TierRow> Solver::tiers() const {
  std::vector<TierRow> rows;
  if (impl_->state == State::empty) return rows;
  const plan::Plan& p = impl_->plan;
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
  if (impl_->state == State::empty) throw std::logic_error("Solver::save_analysis: there is no analysis");
  return guarded([&] {
    const auto& e = impl_->equations;
    solver::write_analysis(path, {impl_->kind, impl_->plan.tree, e.row_scale, e.col_scale, e.row_of_col},
                           e.caller_pattern);
  });
}

AnalysisResult Solver::load_analysis(const std::string& path, const MatrixView& a) {
  impl_->analysis = AnalysisResult{};
  const Status status = guarded([&] {
    impl_->expect_usable();
    impl_->load_analysis(path, a);
  });
  if (!status.ok()) impl_->state = State::empty;
  impl_->analysis.status = status;
  return copy_of(impl_->analysis);
}

Status Solver::write_trace(const std::string& path) const {
  if (!impl_->timeline) throw std::logic_error("Solver::write_trace: Options::record_timeline was not set");
  return guarded([&] { impl_->timeline->write(path); });
}

}  // namespace espalier

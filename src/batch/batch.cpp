#include "espalier/batch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/at.hpp"
#include "base/stopwatch.hpp"
#include "batch/chunks.hpp"
#include "batch/workers.hpp"
#include "solver/session.hpp"
#include "solver/solution.hpp"
#include "solver/status_of.hpp"

namespace espalier {

namespace {

using batch::options_of_worker;
using batch::share;
using solver::Session;

constexpr const char* kRemedy = "use fewer threads or a machine with more memory";

// A session without the caller's callbacks, with a factor of its own on `analysis`.
std::unique_ptr<Session> make_worker(const Options& options, const solver::SharedAnalysis& analysis) {
  auto session = std::make_unique<Session>(options);
  solver::Values values;
  values.resize(static_cast<std::size_t>(analysis->system->prepared.a.nonzeros()));
  session->factor.emplace(analysis, std::move(values), session->context);
  return session;
}

struct Right {
  const double* b;
  double* x;
  Index columns;
  bool transpose;
};

// Factorizes and solves; what fails is a status.
SystemResult solve_one(Session& session, std::span<const double> values, const Right& right) {
  SystemResult result;
  solver::Factor& factor = *session.factor;
  Status status = solver::status_of(session.interruption, kRemedy, [&] {
    session.note_devices();
    factor.factorize(values);
    const FactorResult& f = factor.result();
    result.status = f.status;
    result.inertia = f.inertia;
    result.rank = f.rank;
    result.perturbed = f.perturbed;
    if (!f.status.ok()) return;
    SolveResult solved = solver::solve(factor, {right.b, right.x, right.columns, right.transpose}, session.context);
    result.refinement_steps = solved.refinement_steps;
    result.backward_error = solved.backward_error;
    result.componentwise_error = solved.componentwise_error;
    result.status = std::move(solved.status);
  });
  if (!status.ok()) result.status = std::move(status);
  if (!result.status.ok() && result.status.code != StatusCode::accuracy_not_reached)
    std::fill_n(right.x, at(factor.analysis()->n()) * at(right.columns), std::numeric_limits<double>::quiet_NaN());
  return result;
}

void summarize(BatchResult& result) {
  Index first = -1;
  for (std::size_t k = 0; k < result.systems.size(); ++k) {
    if (result.systems[k].status.ok()) continue;
    if (first < 0) first = static_cast<Index>(k);
    ++result.failed;
  }
  if (first < 0) return;
  const Status& s = result.systems[at(first)].status;
  result.status = {s.code,
                   fmt::format("{} of {} systems failed, first system {}: {}", result.failed, result.systems.size(),
                               first, s.message),
                   s.row};
}

}  // namespace

struct Batch::Impl {
  explicit Impl(Options options) : session(std::move(options)) {}

  // The host's threads, or the one device that was chosen.
  [[nodiscard]] int workers_for(Index count) const {
    const bool host = !session.current().device.backend->limits().own_memory;
    return host ? std::min<int>(session.pool.size(), std::max<Index>(1, count)) : 1;
  }

  // A factor that has gone its own way (moved pivots, another kind or precision, verdicts that it remembers) would
  // treat the next system otherwise than a fresh one does.
  Session& worker(int k) {
    std::unique_ptr<Session>& s = sessions[static_cast<std::size_t>(k)];
    if (s == nullptr || !s->factor->like_new())
      s = make_worker(options_of_worker(session.options, threads_each, static_cast<int>(sessions.size())), analysis);
    return *s;
  }

  void prepare(int workers) {
    const int threads = std::max(1, session.pool.size() / workers);
    if (static_cast<int>(sessions.size()) == workers && threads == threads_each) return;
    sessions.clear();
    sessions.resize(static_cast<std::size_t>(workers));
    threads_each = threads;
  }

  Session session;                  // analyzes
  solver::SharedAnalysis analysis;  // null: none
  batch::Chunks chunks{session};
  std::vector<std::unique_ptr<Session>> sessions;
  int threads_each = 1;
};

Batch::Batch(Options options) : impl_(std::make_unique<Impl>(std::move(options))) {}
Batch::~Batch() = default;
Batch::Batch(Batch&&) noexcept = default;
Batch& Batch::operator=(Batch&&) noexcept = default;

AnalysisResult Batch::analyze(const MatrixView& a) {
  Impl& m = *impl_;
  m.sessions.clear();
  m.chunks.forget();
  m.analysis.reset();
  AnalysisResult result;
  result.status = solver::status_of(m.session.interruption, kRemedy, [&] {
    m.session.analyze(a);
    m.analysis = m.session.factor->analysis();
  });
  if (!result.status.ok()) return result;
  return m.session.analysis;
}

BatchResult Batch::solve(std::span<const double> values, std::span<const double> b, std::span<double> x, Index count,
                         Index columns, Transpose transpose) {
  Impl& m = *impl_;
  if (m.analysis == nullptr) throw std::logic_error("Batch::solve: call analyze() first");
  const std::size_t nonzeros = static_cast<std::size_t>(m.analysis->system->prepared.caller_nonzeros);
  if (count < 0 || columns < 1)
    throw std::invalid_argument(fmt::format("Batch::solve: {} systems with {} right-hand sides", count, columns));
  const std::size_t size = at(m.analysis->n()) * at(columns), all = size * at(count);
  if (values.size() != nonzeros * at(count) || b.size() != all || x.size() != all)
    throw std::invalid_argument(
        fmt::format("Batch::solve: {} systems need {} values and {} numbers in b and x; there are {}, {} and {}", count,
                    nonzeros * at(count), all, values.size(), b.size(), x.size()));
  const double start = base::now_seconds();
  BatchResult result;
  Status status = solver::status_of(m.session.interruption, kRemedy, [&] {
    if (m.session.opening.valid()) m.session.opening.wait();
    const int workers = result.workers = m.workers_for(count);
    m.prepare(workers);
    result.systems.resize(at(count));
    const bool transposed = transpose != Transpose::no;
    const std::vector<char> left = m.chunks.solve(m.analysis, {values, b.data(), x.data(), count, columns, transposed},
                                                  result.systems, result.workers);
    share(m.session.pool, workers, count, [&](int worker, Index k) {
      if (left[at(k)] == 0) return;
      const std::size_t first = at(k) * size;
      result.systems[at(k)] = solve_one(m.worker(worker), values.subspan(at(k) * nonzeros, nonzeros),
                                        {b.data() + first, x.data() + first, columns, transposed});
    });
  });
  if (status.ok())
    summarize(result);
  else
    result.status = std::move(status);
  result.seconds = base::now_seconds() - start;
  return result;
}

namespace {

void check_sizes(std::span<const System> systems) {
  for (std::size_t k = 0; k < systems.size(); ++k) {
    const System& s = systems[k];
    const std::size_t size = at(std::max<Index>(0, s.a.cols)) * at(std::max<Index>(0, s.columns));
    if (s.columns < 1 || s.b.size() != size || s.x.size() != size)
      throw std::invalid_argument(fmt::format(
          "solve_systems: system {} has {} columns and {} right-hand sides: b and x need {} numbers, they have "
          "{} and {}",
          k, s.a.cols, s.columns, size, s.b.size(), s.x.size()));
  }
}

SystemResult solve_alone(const System& system, const Options& options) {
  SystemResult result;
  Session session(options);
  result.status = solver::status_of(session.interruption, kRemedy, [&] {
    if (system.a.values.empty() && system.a.nonzeros() > 0)
      throw Error(StatusCode::invalid_input, "the matrix has no values; a pattern cannot be factorized");
    session.analyze(system.a);
  });
  if (!result.status.ok()) {
    std::fill(system.x.begin(), system.x.end(), std::numeric_limits<double>::quiet_NaN());
    return result;
  }
  return solve_one(session, system.a.values,
                   {system.b.data(), system.x.data(), system.columns, system.transpose != Transpose::no});
}

}  // namespace

BatchResult solve_systems(std::span<const System> systems, const Options& options) {
  check_sizes(systems);
  const double start = base::now_seconds();
  const auto count = static_cast<Index>(systems.size());
  Session session(options);  // threads, and the caller's wish to stop
  BatchResult result;
  Status status = solver::status_of(session.interruption, kRemedy, [&] {
    result.workers = std::min<int>(session.pool.size(), std::max<Index>(1, count));
    const Options of_worker =
        options_of_worker(options, std::max(1, session.pool.size() / result.workers), result.workers);
    result.systems.resize(systems.size());
    share(session.pool, result.workers, count,
          [&](int, Index k) { result.systems[at(k)] = solve_alone(systems[at(k)], of_worker); });
  });
  if (status.ok())
    summarize(result);
  else
    result.status = std::move(status);
  result.seconds = base::now_seconds() - start;
  return result;
}

}  // namespace espalier

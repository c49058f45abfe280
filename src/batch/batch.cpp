#include "espalier/batch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/at.hpp"
#include "base/stopwatch.hpp"
#include "batch/alone.hpp"
#include "batch/chunks.hpp"
#include "batch/workers.hpp"
#include "solver/session/session.hpp"
#include "solver/session/status_of.hpp"
#include "solver/solution/solution.hpp"

namespace espalier {

namespace {

using batch::kRemedy;
using batch::options_of_worker;
using batch::share;
using solver::Session;

// A session without the caller's callbacks, with a factor of its own on `analysis`.
std::unique_ptr<Session> make_worker(const Options& options, const solver::SharedAnalysis& analysis) {
  auto session = std::make_unique<Session>(options);
  solver::Values values;
  values.resize(at(analysis->system->prepared.a.nonzeros()));
  session->factor.emplace(analysis, std::move(values), session->context);
  return session;
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
    std::unique_ptr<Session>& s = sessions[at(k)];
    if (s == nullptr || !s->factor->like_new())
      s = make_worker(options_of_worker(session.options, threads_each, static_cast<int>(sessions.size())), analysis);
    return *s;
  }

  void prepare(int workers) {
    const int threads = std::max(1, session.pool.size() / workers);
    if (static_cast<int>(sessions.size()) == workers && threads == threads_each) return;
    sessions.clear();
    sessions.resize(at(workers));
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
  const std::size_t nonzeros = at(m.analysis->system->prepared.caller_nonzeros);
  if (count < 0 || columns < 1)
    throw std::invalid_argument(fmt::format("Batch::solve: {} systems with {} right-hand sides", count, columns));
  const std::size_t size = at(m.analysis->n()) * at(columns), all = size * at(count);
  if (values.size() != nonzeros * at(count) || b.size() != all || x.size() != all)
    throw std::invalid_argument(
        fmt::format("Batch::solve: {} systems need {} values and {} numbers in b and x; there are {}, {} and {}", count,
                    nonzeros * at(count), all, values.size(), b.size(), x.size()));
  const double start = base::now_seconds();
  return batch::carry_out(m.session, start, [&](BatchResult& result) {
    if (m.session.opening.valid()) m.session.opening.wait();
    const int workers = result.workers = m.workers_for(count);
    m.prepare(workers);
    result.systems.resize(at(count));
    const bool transposed = transpose != Transpose::no;
    std::vector<batch::ChunkSystem> systems;
    for (std::size_t k = 0; k < at(count); ++k)
      systems.push_back({values.subspan(k * nonzeros, nonzeros), b.data() + k * size, x.data() + k * size});
    const std::vector<char> left =
        m.chunks.solve(m.analysis, {systems, columns, transposed}, result.systems, result.workers);
    share(m.session.pool, workers, count, [&](int worker, Index k) {
      if (left[at(k)] == 0) return;
      result.systems[at(k)] = batch::solve_one(m.worker(worker), systems[at(k)], columns, transposed);
    });
  });
}

}  // namespace espalier

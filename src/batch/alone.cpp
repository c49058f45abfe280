#include "batch/alone.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "base/at.hpp"
#include "base/stopwatch.hpp"
#include "batch/workers.hpp"
#include "solver/session/status_of.hpp"
#include "solver/solution/solution.hpp"

namespace espalier::batch {

SystemResult solve_one(solver::Session& session, const ChunkSystem& system, Index columns, bool transpose) {
  SystemResult result;
  solver::Factor& factor = *session.factor;
  Status status = solver::status_of(session.interruption, kRemedy, [&] {
    session.note_devices();
    factor.factorize(system.values);
    const FactorResult& f = factor.result();
    result.status = f.status;
    result.inertia = f.inertia;
    result.rank = f.rank;
    result.perturbed = f.perturbed;
    if (!f.status.ok()) return;
    SolveResult solved = solver::solve(factor, {system.b, system.x, columns, transpose}, session.context);
    result.refinement_steps = solved.refinement_steps;
    result.backward_error = solved.backward_error;
    result.componentwise_error = solved.componentwise_error;
    result.status = std::move(solved.status);
  });
  if (!status.ok()) result.status = std::move(status);
  if (!result.status.ok() && result.status.code != StatusCode::accuracy_not_reached)
    forget_solution({system.x, at(factor.analysis()->n()) * at(columns)});
  return result;
}

SystemResult solve_alone(const System& system, const Options& options) {
  SystemResult result;
  solver::Session session(options);
  result.status = solver::status_of(session.interruption, kRemedy, [&] {
    expect_values(system.a);
    session.analyze(system.a);
  });
  if (!result.status.ok()) {
    forget_solution(system.x);
    return result;
  }
  return solve_one(session, {system.a.values, system.b.data(), system.x.data()}, system.columns,
                   system.transpose != Transpose::no);
}

int solve_on_threads(solver::Session& session, std::span<const System> systems, std::span<const Index> numbers,
                     int workers, std::span<SystemResult> results) {
  const auto count = static_cast<Index>(numbers.size());
  workers = std::min<int>(workers, std::max<Index>(1, count));
  const Options options = options_of_worker(session.options, std::max(1, session.pool.size() / workers), workers);
  share(session.pool, workers, count, [&](int, Index k) {
    const std::size_t number = at(numbers[at(k)]);
    results[number] = solve_alone(systems[number], options);
  });
  return workers;
}

void expect_values(const MatrixView& a) {
  if (a.values.empty() && a.nonzeros() > 0)
    throw Error(StatusCode::invalid_input, "the matrix has no values; a pattern cannot be factorized");
}

void forget_solution(std::span<double> x) { std::fill(x.begin(), x.end(), std::numeric_limits<double>::quiet_NaN()); }

namespace {

// Counts failures, and makes the status of all.
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

BatchResult carry_out(solver::Session& session, double start, const std::function<void(BatchResult&)>& work) {
  BatchResult result;
  Status status = solver::status_of(session.interruption, kRemedy, [&] { work(result); });
  if (status.ok())
    summarize(result);
  else
    result.status = std::move(status);
  result.seconds = base::now_seconds() - start;
  return result;
}

}  // namespace espalier::batch

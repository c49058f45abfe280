#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "solve/refinement_steps.hpp"

namespace espalier::solve {

namespace {

// A Krylov correction reduces the residual by that much per restart; the next residual is computed afresh.
constexpr double kKrylovReduction = 1e-6;

// Rows in which A, x and b meet only in zeros have a componentwise error of about 1 for ever. Above this normwise error
// (some 50 roundings) a step that halves it is one in the right direction whatever they say.
constexpr double kNormwiseMatters = 1e-14;

// A plain step that leaves more of the error than this costs more than a step of a Krylov method gains...
constexpr double kFast = 0.1;
// ... unless nothing is left to gain.
constexpr double kAtRounding = 1e-15;

// Above this normwise error x may be noise along what A nearly loses, and step by step get rid of 16 digits of it: the
// residual falls, and x as fast, so that their ratio says nothing. Of the residual's squares that much may be left
// then.
constexpr double kNoise = 1e-10;
constexpr double kFallen = 1e-4;

}  // namespace

bool worth_a_step(const BackwardError& error, int steps_taken, const RefinementOptions& options) {
  return error.componentwise > options.target && !(error.normwise <= options.normwise_target) &&
         steps_taken < options.steps;
}

StepVerdict judge_step(const BackwardError& before, const BackwardError& now) {
  const bool falls = before.normwise > kNormwiseMatters && now.normwise <= before.normwise / 2;
  const bool better = falls || now.componentwise < before.componentwise ||
                      (now.componentwise == before.componentwise && now.normwise < before.normwise);
  return {better, !falls && !(now.componentwise <= before.componentwise / 2)};
}

Refinement::Refinement(const ResidualSpace& a, const Systems& systems, const RefinementOptions& options)
    : a_(a), transpose_(systems.transpose), options_(options), n_(a.size()), columns_(at(systems.columns)) {
  if (options.steps > 0) {  // else errors are wanted, not residuals
    residuals_ = a.vectors(0, systems.columns);
    trials_ = a.vectors(1, systems.columns);
  }
  for (std::size_t k = 0; k < columns_.size(); ++k) {
    columns_[k].b = systems.b + static_cast<Offset>(k) * n_;
    columns_[k].x = systems.x + static_cast<Offset>(k) * n_;
    active_.push_back(&columns_[k]);
  }
  take_places();
  find_residuals(active_);
  for (Column* c : active_) c->done = !worth_going_on(*c);
  leave_out_done();
}

bool Refinement::worth_going_on(const Column& c) const {
  return worth_a_step(c.result.error, c.result.steps, options_) &&
         (!c.krylov || c.result.krylov_steps < options_.krylov_steps);
}

void Refinement::leave_out_done() {
  std::erase_if(active_, [](const Column* c) { return c->done; });
  take_places();
}

// A residual only ever moves to the left.
void Refinement::take_places() {
  if (residuals_.data == nullptr) return;
  for (std::size_t k = 0; k < active_.size(); ++k) {
    Column& c = *active_[k];
    double* place = residuals_.data + static_cast<Offset>(k) * n_;
    if (c.residual != nullptr && c.residual != place) a_.copy(c.residual, place);
    c.residual = place;
    c.trial = trials_.data + static_cast<Offset>(k) * n_;
  }
}

void Refinement::find_residuals(const std::vector<Column*>& columns) {
  std::vector<ResidualColumn> work;
  for (const Column* c : columns) work.push_back({c->b, c->x, c->residual, {}});
  a_.compute(work, transpose_);
  for (std::size_t k = 0; k < columns.size(); ++k) columns[k]->result.error = work[k].error;
}

// Neighbours that need the same are solved for at once.
void Refinement::correct(const Preconditioner& m) {
  for (std::size_t k = 0; k < active_.size();) {
    std::size_t end = k + 1;
    while (end < active_.size() && active_[end]->krylov == active_[k]->krylov) ++end;
    const std::span<Column* const> group(active_.data() + k, end - k);
    if (group.front()->krylov)
      solve_krylov(m, group);
    else
      m(group.front()->residual, group.front()->trial, static_cast<Index>(group.size()));
    k = end;
  }
}

// One by one where the memory has no room for the vectors of many.
void Refinement::solve_krylov(const Preconditioner& m, std::span<Column* const> group) {
  while (!group.empty()) {
    const std::span<Column* const> now = group.first(std::min(group.size(), most_krylov_));
    try {
      solve_in_lockstep(m, now);
    } catch (const Error& e) {
      if (e.status().code != StatusCode::out_of_memory || now.size() == 1) throw;
      most_krylov_ = 1;
      continue;
    }
    group = group.subspan(now.size());
  }
}

void Refinement::solve_in_lockstep(const Preconditioner& m, std::span<Column* const> group) {
  std::vector<KrylovColumn> columns;
  for (const Column* c : group) columns.push_back({{kKrylovReduction, options_.krylov_steps - c->result.krylov_steps}});
  const double* r = group.front()->residual;
  double* d = group.front()->trial;
  if (options_.positive_definite)
    solve_cg(a_, m, r, d, columns);
  else
    solve_fgmres(a_, m, r, d, transpose_, columns);
  for (std::size_t k = 0; k < group.size(); ++k) group[k]->result.krylov_steps += columns[k].steps;
}

// A correction that is not finite ends its column.
void Refinement::add_corrections() {
  for (Column* c : active_) c->done = !a_.add(c->x, c->trial);
  std::erase_if(active_, [](const Column* c) { return c->done; });
}

double Refinement::squares_of(const Column& c) const {
  return c.result.error.normwise > kNoise ? a_.dot(c.residual, c.residual) : 0;
}

// Takes the trials that are better, and says which columns go on.
void Refinement::judge() {
  std::vector<double> squares;  // of the residuals before
  for (const Column* c : active_) squares.push_back(squares_of(*c));
  std::vector<ResidualColumn> trials;
  for (const Column* c : active_) trials.push_back({c->b, c->trial, c->residual, {}});
  a_.compute(trials, transpose_);
  std::vector<Column*> lost;  // go on from an x whose residual was overwritten
  for (std::size_t k = 0; k < active_.size(); ++k) {
    Column& c = *active_[k];
    const BackwardError before = c.result.error, now = trials[k].error;
    ++c.result.steps;
    auto [better, stalled] = judge_step(before, now);
    if (squares[k] > 0 && std::isfinite(squares[k]) && stalled &&
        a_.dot(c.residual, c.residual) <= kFallen * squares[k]) {
      better = true;
      stalled = false;
    }
    if (better) {
      c.result.error = now;
      a_.copy(c.trial, c.x);
    }
    if (stalled && (c.krylov || !options_.krylov || c.result.error.componentwise <= kAtRounding)) c.done = true;
    const bool slow = now.normwise > kNormwiseMatters && !(now.normwise <= kFast * before.normwise);
    c.krylov = c.krylov || (options_.krylov && (stalled || slow));
    c.done = c.done || !worth_going_on(c);
    if (!c.done && !better) lost.push_back(&c);
  }
  find_residuals(lost);
}

void Refinement::take_corrections() {
  add_corrections();
  judge();
  leave_out_done();
}

RefinementResult Refinement::result() const {
  RefinementResult all;
  for (const Column& c : columns_) {
    all.error.normwise = std::max(all.error.normwise, c.result.error.normwise);
    all.error.componentwise = std::max(all.error.componentwise, c.result.error.componentwise);
    all.steps = std::max(all.steps, c.result.steps);
    all.krylov_steps = std::max(all.krylov_steps, c.result.krylov_steps);
  }
  return all;
}

RefinementResult refine(const ResidualSpace& a, const Preconditioner& m, const Systems& systems,
                        const RefinementOptions& options) {
  const Offset n = a.size();
  RefinementResult all;
  for (Index first = 0; first < systems.columns; first += Refinement::kMostColumns) {
    const Index columns = std::min(Refinement::kMostColumns, systems.columns - first);
    Refinement group(a, {systems.b + first * n, systems.x + first * n, columns, systems.transpose}, options);
    while (!group.done()) {
      group.correct(m);
      group.take_corrections();
    }
    const RefinementResult r = group.result();
    all.error.normwise = std::max(all.error.normwise, r.error.normwise);
    all.error.componentwise = std::max(all.error.componentwise, r.error.componentwise);
    all.steps = std::max(all.steps, r.steps);
    all.krylov_steps = std::max(all.krylov_steps, r.krylov_steps);
  }
  return all;
}

}  // namespace espalier::solve

#include "solve/refinement.hpp"

#include <algorithm>
#include <span>
#include <vector>

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

constexpr Index kColumnsAtOnce = 16;  // bounds the memory: two vectors a column

// One right-hand side on its way.
struct Column {
  const double* b = nullptr;
  double* x = nullptr;         // the best so far
  double* residual = nullptr;  // of the best
  double* trial = nullptr;     // x + correction
  RefinementResult result;
  bool krylov = false;
  bool done = false;
};

class Refinement {
 public:
  Refinement(const ResidualSpace& a, const Preconditioner& m, bool transpose, const RefinementOptions& options,
             Index columns)
      : a_(a), m_(m), transpose_(transpose), options_(options), n_(a.size()) {
    if (options.steps == 0) return;  // errors are wanted, not residuals
    residuals_ = a.vectors(0, columns);
    trials_ = a.vectors(1, columns);
  }

  void run(std::vector<Column>& columns) {
    std::vector<Column*> active;
    for (Column& c : columns) active.push_back(&c);
    take_places(active);
    find_residuals(active);
    for (Column* c : active) c->done = !worth_going_on(*c);
    while (std::erase_if(active, [](const Column* c) { return c->done; }), !active.empty()) {
      take_places(active);
      correct(active);
      add_corrections(active);
      judge(active);
    }
  }

 private:
  [[nodiscard]] bool worth_going_on(const Column& c) const {
    return c.result.error.componentwise > options_.target && c.result.steps < options_.steps &&
           (!c.krylov || c.result.krylov_steps < options_.krylov_steps);
  }

  // Columns that are still active stand side by side, in their order: a residual only ever moves to the left.
  void take_places(const std::vector<Column*>& active) {
    if (residuals_.data == nullptr) return;
    for (std::size_t k = 0; k < active.size(); ++k) {
      Column& c = *active[k];
      double* place = residuals_.data + static_cast<Offset>(k) * n_;
      if (c.residual != nullptr && c.residual != place) a_.copy(c.residual, place);
      c.residual = place;
      c.trial = trials_.data + static_cast<Offset>(k) * n_;
    }
  }

  void find_residuals(const std::vector<Column*>& columns) {
    std::vector<ResidualColumn> work;
    for (const Column* c : columns) work.push_back({c->b, c->x, c->residual, {}});
    a_.compute(work, transpose_);
    for (std::size_t k = 0; k < columns.size(); ++k) columns[k]->result.error = work[k].error;
  }

  // trial = correction of each column; neighbours that need the same are solved for at once.
  void correct(const std::vector<Column*>& active) {
    for (std::size_t k = 0; k < active.size();) {
      std::size_t end = k + 1;
      while (end < active.size() && active[end]->krylov == active[k]->krylov) ++end;
      const std::span<Column* const> group(active.data() + k, end - k);
      if (group.front()->krylov)
        solve_krylov(group);
      else
        m_(group.front()->residual, group.front()->trial, static_cast<Index>(group.size()));
      k = end;
    }
  }

  // One by one where the memory has no room for the vectors of many.
  void solve_krylov(std::span<Column* const> group) {
    while (!group.empty()) {
      const std::span<Column* const> now = group.first(std::min(group.size(), most_krylov_));
      try {
        solve_in_lockstep(now);
      } catch (const Error& e) {
        if (e.status().code != StatusCode::out_of_memory || now.size() == 1) throw;
        most_krylov_ = 1;
        continue;
      }
      group = group.subspan(now.size());
    }
  }

  void solve_in_lockstep(std::span<Column* const> group) {
    std::vector<KrylovColumn> columns;
    for (const Column* c : group)
      columns.push_back({{kKrylovReduction, options_.krylov_steps - c->result.krylov_steps}});
    const double* r = group.front()->residual;
    double* d = group.front()->trial;
    if (options_.positive_definite)
      solve_cg(a_, m_, r, d, columns);
    else
      solve_fgmres(a_, m_, r, d, transpose_, columns);
    for (std::size_t k = 0; k < group.size(); ++k) group[k]->result.krylov_steps += columns[k].steps;
  }

  // trial += x. A correction that is not finite ends its column.
  void add_corrections(std::vector<Column*>& active) {
    for (Column* c : active) c->done = !a_.add(c->x, c->trial);
    std::erase_if(active, [](const Column* c) { return c->done; });
  }

  // Takes the trials that are better, and says which columns go on.
  void judge(const std::vector<Column*>& active) {
    std::vector<ResidualColumn> trials;
    for (const Column* c : active) trials.push_back({c->b, c->trial, c->residual, {}});
    a_.compute(trials, transpose_);
    std::vector<Column*> lost;  // go on from an x whose residual was overwritten
    for (std::size_t k = 0; k < active.size(); ++k) {
      Column& c = *active[k];
      const BackwardError before = c.result.error, now = trials[k].error;
      ++c.result.steps;
      const bool falls = before.normwise > kNormwiseMatters && now.normwise <= before.normwise / 2;
      const bool better = falls || now.componentwise < before.componentwise ||
                          (now.componentwise == before.componentwise && now.normwise < before.normwise);
      if (better) {
        c.result.error = now;
        a_.copy(c.trial, c.x);
      }
      const bool stalled = !falls && !(now.componentwise <= before.componentwise / 2);
      if (stalled && (c.krylov || !options_.krylov || c.result.error.componentwise <= kAtRounding)) c.done = true;
      const bool slow = now.normwise > kNormwiseMatters && !(now.normwise <= kFast * before.normwise);
      c.krylov = c.krylov || (options_.krylov && (stalled || slow));
      c.done = c.done || !worth_going_on(c);
      if (!c.done && !better) lost.push_back(&c);
    }
    find_residuals(lost);
  }

  const ResidualSpace& a_;
  const Preconditioner& m_;
  bool transpose_;
  const RefinementOptions& options_;
  Index n_;
  ResidualSpace::Vectors residuals_, trials_;  // n x columns
  std::size_t most_krylov_ = static_cast<std::size_t>(kColumnsAtOnce);
};

}  // namespace

RefinementResult refine(const ResidualSpace& a, const Preconditioner& m, const Systems& systems,
                        const RefinementOptions& options) {
  const auto n = static_cast<std::size_t>(a.size());
  RefinementResult all;
  Refinement refinement(a, m, systems.transpose, options, std::min(systems.columns, kColumnsAtOnce));
  for (Index first = 0; first < systems.columns; first += kColumnsAtOnce) {
    std::vector<Column> group(static_cast<std::size_t>(std::min(kColumnsAtOnce, systems.columns - first)));
    for (std::size_t k = 0; k < group.size(); ++k) {
      group[k].b = systems.b + (static_cast<std::size_t>(first) + k) * n;
      group[k].x = systems.x + (static_cast<std::size_t>(first) + k) * n;
    }
    refinement.run(group);
    for (const Column& c : group) {
      all.error.normwise = std::max(all.error.normwise, c.result.error.normwise);
      all.error.componentwise = std::max(all.error.componentwise, c.result.error.componentwise);
      all.steps = std::max(all.steps, c.result.steps);
      all.krylov_steps = std::max(all.krylov_steps, c.result.krylov_steps);
    }
  }
  return all;
}

}  // namespace espalier::solve

#include "solve/refinement.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace espalier::solve {

namespace {

// A Krylov correction reduces the residual by that much per restart; the next residual is computed afresh.
constexpr double kKrylovReduction = 1e-6;

bool finite(const std::vector<double>& v) {
  return std::all_of(v.begin(), v.end(), [](double x) { return std::isfinite(x); });
}

}  // namespace

namespace {

constexpr Index kColumnsAtOnce = 32;  // bounds the memory: three vectors a column

// One right-hand side on its way.
struct Column {
  const double* b = nullptr;
  double* x = nullptr;           // the best so far
  std::vector<double> trial;     // x + correction
  std::vector<double> residual;  // of the best
  RefinementResult result;
  bool krylov = false;
  bool done = false;
};

class Refinement {
 public:
  Refinement(const ResidualOperator& a, const Preconditioner& m, bool transpose, const RefinementOptions& options)
      : a_(a), m_(m), transpose_(transpose), options_(options), n_(static_cast<std::size_t>(a.size())) {}

  void run(std::vector<Column>& columns) {
    for (Column& c : columns) {
      c.trial.resize(n_);
      c.residual.resize(n_);
      c.result.error = a_.compute(c.b, c.x, c.residual.data(), transpose_);
      c.done = !worth_going_on(c);
    }
    for (;;) {
      std::vector<Column*> active;
      for (Column& c : columns)
        if (!c.done) active.push_back(&c);
      if (active.empty()) return;
      correct(active);
      for (Column* c : active) judge(*c);
    }
  }

 private:
  [[nodiscard]] bool worth_going_on(const Column& c) const {
    return c.result.error.componentwise > options_.target && c.result.steps < options_.steps &&
           (!c.krylov || c.result.krylov_steps < options_.krylov_steps);
  }

  // trial = correction of each column; plain refinement solves for all columns at once.
  void correct(const std::vector<Column*>& active) {
    std::vector<Column*> plain;
    for (Column* c : active) {
      if (!c->krylov) {
        plain.push_back(c);
        continue;
      }
      const int left = options_.krylov_steps - c->result.krylov_steps;
      c->result.krylov_steps += options_.positive_definite
                                    ? solve_cg(a_, m_, c->residual, c->trial, kKrylovReduction, left)
                                    : solve_fgmres(a_, m_, c->residual, c->trial, transpose_, kKrylovReduction, left);
    }
    if (plain.empty()) return;
    block_.resize(n_ * plain.size());
    for (std::size_t k = 0; k < plain.size(); ++k) std::copy_n(plain[k]->residual.data(), n_, block_.data() + k * n_);
    m_(block_.data(), block_.data(), static_cast<Index>(plain.size()));
    for (std::size_t k = 0; k < plain.size(); ++k) std::copy_n(block_.data() + k * n_, n_, plain[k]->trial.data());
  }

  void judge(Column& c) {
    if (!finite(c.trial)) {
      c.done = true;
      return;
    }
    for (std::size_t i = 0; i < n_; ++i) c.trial[i] += c.x[i];
    ++c.result.steps;
    next_.resize(n_);
    const BackwardError now = a_.compute(c.b, c.trial.data(), next_.data(), transpose_);
    const BackwardError before = c.result.error;
    if (now.componentwise < before.componentwise ||
        (now.componentwise == before.componentwise && now.normwise < before.normwise)) {
      c.result.error = now;
      std::copy(c.trial.begin(), c.trial.end(), c.x);
      c.residual.swap(next_);
    }
    const bool stalled = !(now.componentwise <= before.componentwise / 2);
    if (stalled && (c.krylov || !options_.krylov)) c.done = true;
    if (stalled) c.krylov = options_.krylov;
    c.done = c.done || !worth_going_on(c);
  }

  const ResidualOperator& a_;
  const Preconditioner& m_;
  bool transpose_;
  const RefinementOptions& options_;
  std::size_t n_;
  std::vector<double> block_, next_;
};

}  // namespace

RefinementResult refine(const ResidualOperator& a, const Preconditioner& m, const double* b, double* x, Index columns,
                        bool transpose, const RefinementOptions& options) {
  const auto n = static_cast<std::size_t>(a.size());
  RefinementResult all;
  Refinement refinement(a, m, transpose, options);
  for (Index first = 0; first < columns; first += kColumnsAtOnce) {
    std::vector<Column> group(static_cast<std::size_t>(std::min(kColumnsAtOnce, columns - first)));
    for (std::size_t k = 0; k < group.size(); ++k) {
      group[k].b = b + (static_cast<std::size_t>(first) + k) * n;
      group[k].x = x + (static_cast<std::size_t>(first) + k) * n;
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

/// \file
/// Refinement step by step: for those who solve for the corrections of several systems at once.
#pragma once

#include <span>
#include <vector>

#include "solve/refinement.hpp"

namespace espalier::solve {

/// Whether a solution with these errors is worth another step.
bool worth_a_step(const BackwardError& error, int steps_taken, const RefinementOptions& options);
/// What a plain step has brought: nothing is gained any more where it stalls.
struct StepVerdict {
  bool better, stalled;
};
StepVerdict judge_step(const BackwardError& before, const BackwardError& now);

/// What refine() does with up to kMostColumns right-hand sides of one matrix:
///   while (!r.done()) { solve for r.corrections() (r.columns() of them, from r.residuals()); r.take_corrections(); }
class Refinement {
 public:
  static constexpr Index kMostColumns = 16;  // bounds the memory: two vectors a column

  /// @param a, options  outlive this
  Refinement(const ResidualSpace& a, const Systems& systems, const RefinementOptions& options);
  Refinement(const Refinement&) = delete;
  Refinement& operator=(const Refinement&) = delete;

  [[nodiscard]] bool done() const { return active_.empty(); }
  /// Right-hand sides that are not done: residuals and corrections stand side by side.
  [[nodiscard]] Index columns() const { return static_cast<Index>(active_.size()); }
  [[nodiscard]] const double* residuals() const { return residuals_.data; }
  [[nodiscard]] double* corrections() const { return trials_.data; }
  /// Solves for the corrections, where options say so by Krylov methods.
  void correct(const Preconditioner& m);
  /// Adds them, and keeps what is better.
  void take_corrections();
  /// The largest errors and the most steps of any column.
  [[nodiscard]] RefinementResult result() const;

 private:
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

  [[nodiscard]] bool worth_going_on(const Column& c) const;
  void leave_out_done();
  void take_places();
  void find_residuals(const std::vector<Column*>& columns);
  void solve_krylov(const Preconditioner& m, std::span<Column* const> group);
  void solve_in_lockstep(const Preconditioner& m, std::span<Column* const> group);
  [[nodiscard]] double squares_of(const Column& c) const;
  void add_corrections();
  void judge();

  const ResidualSpace& a_;
  bool transpose_;
  const RefinementOptions& options_;
  Index n_;
  std::vector<Column> columns_;
  std::vector<Column*> active_;
  ResidualSpace::Vectors residuals_, trials_;  // n x columns
  std::size_t most_krylov_ = at(kMostColumns);
};

}  // namespace espalier::solve

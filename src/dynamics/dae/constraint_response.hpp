/// \file
/// What K's inverse makes of the constraints alone: K^-1 [0; I]. Projections onto the levels of the constraints need no
/// more of K, and a step makes many of them.
#pragma once

#include <functional>
#include <vector>

#include "base/thread_pool.hpp"
#include "dynamics/dae/system.hpp"

namespace espalier::dynamics {

/// Answers K x = [0; r] by a product with the columns of K^-1 [0; I], one for each constraint, where that is cheaper
/// than the factor. The columns belong to one factor. They are made at once where the factor before had enough to do
/// that they would have paid, and otherwise when this one has had. What is decided depends on counts alone, so that
/// runs repeat to the bit.
class ConstraintResponse {
 public:
  /// The factor is another one. @param n, m  rows of K: motion, constraints
  /// @param dropped  m marks: constraints whose rows of K are empty; their r is zero
  /// @param entries  numbers that a solve with the factor reads; 0: not known, no columns are made
  void start(Index n, Index m, const std::vector<char>& dropped, Offset entries);
  /// What factors before have had to do counts no more.
  void forget() { solved_ = before_ = 0; }
  /// Whether apply() can be used. `columns` right-hand sides [0; r] are to be solved for; makes the columns where that
  /// pays.
  /// @param solve  solves K X = B in place for the given number of columns, each n + m
  /// Without memory for the columns there are none.
  [[nodiscard]] bool ready(Index columns, const std::function<void(Span, Index)>& solve);
  /// The columns are known: n + m numbers for each constraint that is not dropped.
  void take(std::vector<double> columns);
  /// Gives the columns away; none where there are none. They are not known any more.
  [[nodiscard]] std::vector<double> give();
  /// x = K^-1 [0; r], r the last m of x. @pre ready()
  void apply(Span x, base::ThreadPool* pool) const;
  /// Columns that were made of this factor.
  [[nodiscard]] Index columns() const { return static_cast<Index>(made_ ? kept_.size() : 0); }

 private:
  void make(const std::function<void(Span, Index)>& solve);

  Index n_ = 0, m_ = 0;
  std::vector<Index> kept_;  // constraints that have a column
  Offset entries_ = 0;
  Index solved_ = 0, before_ = 0;  // right-hand sides [0; r] of this factor and of the one before
  bool made_ = false;
  std::vector<double> columns_;    // (n + m) * kept, column by column
  mutable std::vector<double> r_;  // kept
};

}  // namespace espalier::dynamics
